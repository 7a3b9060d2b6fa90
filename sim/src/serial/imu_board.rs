//! The simulated OpenCR board: a node on the servos' Dynamixel 2 line that measures how
//! the root link moves.
//!
//! It answers Ping, Read, Write, Sync Read and Bulk Read, and no fast read. What it
//! measures without a world is a robot that stands still. Switching the servos' power
//! and calibrating are stored, without effect.

use servodance_drivers::ImuConfig;
use servodance_drivers::imu::Mounting;
use servodance_drivers::imu::opencr::{encode, registers as at};
use servodance_drivers::serial::Register;
use servodance_types::ImuState;

use crate::servo::dynamixel2::table::AccessError;
use crate::world::SharedWorld;

/// What a host may write.
const WRITABLE: [Register; 10] = [
    at::ID,
    at::BAUD,
    at::RETURN_DELAY,
    at::STATUS_RETURN_LEVEL,
    at::OFFSETS,
    at::POWER,
    at::LED,
    at::LED_RGB,
    at::BUZZER,
    at::IMU_CONTROL,
];
/// A level robot at rest.
const LEVEL: ImuState =
    ImuState { rate_rad_s: [0.0; 3], force_m_s2: [0.0, 0.0, 9.80665], up: [0.0, 0.0, 1.0] };

#[derive(Debug)]
pub(crate) struct ImuBoard {
    memory: [u8; at::SIZE],
    mounting: Mounting,
    world: Option<SharedWorld>,
    pub silent: bool,
}

impl ImuBoard {
    /// As it leaves the factory but for its id, on a supply of so many volts.
    pub fn new(config: &ImuConfig, world: Option<SharedWorld>, supply_v: f64) -> Self {
        let mut memory = [0; at::SIZE];
        memory[at::MODEL.range()].copy_from_slice(&at::MODEL_NUMBER.to_le_bytes());
        memory[at::FIRMWARE.range()].copy_from_slice(&[at::FIRMWARE_VERSION]);
        memory[at::ID.range()].copy_from_slice(&[config.id()]);
        memory[at::STATUS_RETURN_LEVEL.range()].copy_from_slice(&[2]);
        memory[at::POWER.range()].copy_from_slice(&[1]);
        memory[at::VOLTAGE.range()].copy_from_slice(&[(supply_v * 10.0).round() as u8]);
        Self { memory, mounting: config.mounting(), world, silent: false }
    }

    fn byte(&self, register: Register) -> u8 {
        self.memory[register.range().start]
    }

    /// Whether a packet to this id is for it.
    pub fn hears(&self, id: u8) -> bool {
        !self.silent && self.id() == id
    }

    pub fn id(&self) -> u8 {
        self.byte(at::ID)
    }

    pub fn return_delay_s(&self) -> f64 {
        f64::from(self.byte(at::RETURN_DELAY)) * 2e-6
    }

    /// 0: answers pings only; 1: and reads; 2: everything.
    pub fn return_level(&self) -> u8 {
        self.byte(at::STATUS_RETURN_LEVEL)
    }

    pub fn ping(&self) -> [u8; 3] {
        [self.memory[0], self.memory[1], self.byte(at::FIRMWARE)]
    }

    pub fn read(&mut self, address: u16, size: u16) -> Result<Vec<u8>, AccessError> {
        let state = self.world.as_ref().map_or(LEVEL, SharedWorld::imu);
        self.memory[at::READING.range()].copy_from_slice(&encode(&state, &self.mounting));
        let start = usize::from(address);
        let read = self.memory.get(start..start + usize::from(size));
        read.map(<[u8]>::to_vec).ok_or(AccessError::Access)
    }

    /// Stores whole registers that may be written.
    pub fn write(&mut self, address: u16, bytes: &[u8]) -> Result<(), AccessError> {
        let (start, end) = (usize::from(address), usize::from(address) + bytes.len());
        let mut at = start;
        while at < end {
            let register = WRITABLE.iter().find(|register| register.range().start == at);
            at = register.ok_or(AccessError::Access)?.range().end;
        }
        if at != end {
            return Err(AccessError::Length);
        }
        self.memory[start..end].copy_from_slice(bytes);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::line::Line;
    use crate::serial::protocol2_line::Protocol2Line;

    fn hex(bytes: &[u8]) -> String {
        bytes.iter().map(|byte| format!("{byte:02X}")).collect()
    }

    fn answers(line: &mut Protocol2Line, sent: &str) -> Vec<String> {
        let digits = sent.as_bytes().chunks_exact(2);
        let bytes = digits.map(|two| u8::from_str_radix(std::str::from_utf8(two).unwrap(), 16));
        let mut said = Vec::new();
        for byte in bytes {
            if line.push(byte.unwrap()) {
                said.extend(line.execute(0.0).iter().map(|burst| hex(&burst.bytes)));
            }
        }
        said
    }

    fn line() -> Protocol2Line {
        let config = ImuConfig {
            mounting_deg: [0.0, 0.0, 180.0],
            ..ImuConfig::of_kind(servodance_drivers::ImuKind::Opencr)
        };
        let board = ImuBoard::new(&config, None, 12.0);
        Protocol2Line::new(Vec::new(), 1_000_000, 0.0).with_board(Some(board))
    }

    #[test]
    fn a_ping_and_a_reading_are_answered_to_the_byte() {
        let mut line = line();
        let ping = "FFFFFD00C80300013BFA";
        assert_eq!(answers(&mut line, ping), ["FFFFFD00C8070055000074054C6F"]);
        let level = "FFFFFD00C816005500000000000000000000000040000000000000D646";
        assert_eq!(answers(&mut line, "FFFFFD00C807000220001200B0A3"), [level]);
        line.silence_board(true);
        assert!(answers(&mut line, ping).is_empty());
    }

    #[test]
    fn what_is_read_only_stays() {
        let config = ImuConfig::of_kind(servodance_drivers::ImuKind::Opencr);
        let mut board = ImuBoard::new(&config, None, 12.0);
        assert_eq!(board.write(32, &[1, 2]), Err(AccessError::Access));
        assert_eq!(board.write(26, &[1]), Err(AccessError::Length));
        assert_eq!(board.write(24, &[0, 7]), Ok(()));
        assert_eq!(board.read(24, 2), Ok(vec![0, 7]));
        assert_eq!(board.read(50, 2), Err(AccessError::Access));
    }
}
