//! WitMotion boards (WT61, JY61: an MPU-6050 behind a processor; JY901, WT901, HWT901): three
//! packets a measurement, on a serial port or, without checksum, in CAN frames.
//!
//! ```text
//! 55 51 ax ay az temperature sum    16 g / 32768
//! 55 52 wx wy wz temperature sum    2000 degrees/s / 32768
//! 55 53 roll pitch yaw version sum  180 degrees / 32768; sum: low byte of the bytes before
//! CAN:  id 50, data 55 51 ax ay az and so on
//! ```
//!
//! The board has to be set to send these three, 100 times a second at 115200 baud or
//! faster (9600 at the factory), and on CAN to the bus's bitrate. Figures from the vendor's
//! data sheet of the WT901; nothing was compared with a real board.

use servodance_types::ImuState;

use super::protocol::ImuProtocol;
use super::{GRAVITY_M_S2, three_words, words};

/// Id of its CAN frames as it leaves the factory.
pub const FACTORY_ID: u8 = 0x50;
/// Bytes of a packet on a serial port, and of the part that a CAN frame has.
const PACKET: usize = 11;
const FRAME: usize = 8;
const HEAD: u8 = 0x55;
const ACCELERATION: u8 = 0x51;
const RATE: u8 = 0x52;
const ANGLE: u8 = 0x53;

/// Whole numbers an acceleration of gravity, a degree a second, a degree.
const PER_GRAVITY: f64 = 32768.0 / 16.0;
const PER_DEG_S: f64 = 32768.0 / 2000.0;
const PER_DEG: f64 = 32768.0 / 180.0;

/// What has come of a measurement.
#[derive(Debug)]
pub struct Witmotion {
    packet: Vec<u8>,
    force_m_s2: Option<[f64; 3]>,
    rate_rad_s: Option<[f64; 3]>,
}

impl Default for Witmotion {
    fn default() -> Self {
        Self { packet: Vec::with_capacity(PACKET), force_m_s2: None, rate_rad_s: None }
    }
}

impl Witmotion {
    /// Nothing has come yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes the data of a CAN frame; a measurement with the last one of it.
    pub fn hear_frame(&mut self, data: &[u8]) -> Option<ImuState> {
        if data.len() != FRAME || data[0] != HEAD {
            return None;
        }
        let values = three_words(data, 2);
        match data[1] {
            ACCELERATION => {
                let force = values.map(|value| value / PER_GRAVITY * GRAVITY_M_S2);
                self.force_m_s2 = Some(force);
                None
            }
            RATE => {
                self.rate_rad_s = Some(values.map(|value| (value / PER_DEG_S).to_radians()));
                None
            }
            ANGLE => {
                let [roll, pitch, _] = values.map(|value| (value / PER_DEG).to_radians().sin_cos());
                let up = [-pitch.0, pitch.1 * roll.0, pitch.1 * roll.1];
                let (rate_rad_s, force_m_s2) = (self.rate_rad_s.take()?, self.force_m_s2.take()?);
                Some(ImuState { rate_rad_s, force_m_s2, up })
            }
            _ => None,
        }
    }
}

impl ImuProtocol for Witmotion {
    fn ask(&mut self, _out: &mut Vec<u8>) {}

    fn hear(&mut self, byte: u8) -> Option<ImuState> {
        self.packet.push(byte);
        if self.packet[0] != HEAD {
            self.packet.clear();
            return None;
        }
        if self.packet.len() < PACKET {
            return None;
        }
        let (data, sum) = self.packet.split_at(PACKET - 1);
        if checksum(data) == sum[0] {
            let mut frame = [0; FRAME];
            frame.copy_from_slice(&data[..FRAME]);
            self.packet.clear();
            return self.hear_frame(&frame);
        }
        // Out of step: from the next head on.
        let next = self.packet[1..].iter().position(|byte| *byte == HEAD);
        self.packet.drain(..next.map_or(PACKET, |at| at + 1));
        None
    }

    fn restart(&mut self) {
        *self = Self::default();
    }
}

fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
}

/// The three CAN frames of a measurement in the board's axes; `yaw_rad` is its heading.
pub fn frames(board: &ImuState, yaw_rad: f64) -> [[u8; FRAME]; 3] {
    let [x, y, z] = board.up;
    let angles = [y.atan2(z), (-x).atan2(y.hypot(z)), yaw_rad];
    let parts = [
        (ACCELERATION, board.force_m_s2.map(|force| force / GRAVITY_M_S2 * PER_GRAVITY)),
        (RATE, board.rate_rad_s.map(|rate| rate.to_degrees() * PER_DEG_S)),
        (ANGLE, angles.map(|angle| angle.to_degrees() * PER_DEG)),
    ];
    parts.map(|(kind, values)| {
        let mut frame = [HEAD, kind, 0, 0, 0, 0, 0, 0];
        frame[2..].copy_from_slice(&words(values));
        frame
    })
}

/// The same on a serial port, at 25 degrees Celsius.
pub fn packets(board: &ImuState, yaw_rad: f64) -> [[u8; PACKET]; 3] {
    frames(board, yaw_rad).map(|frame| {
        let mut packet = [0; PACKET];
        packet[..FRAME].copy_from_slice(&frame);
        packet[FRAME..PACKET - 1].copy_from_slice(&2500_u16.to_le_bytes());
        packet[PACKET - 1] = checksum(&packet[..PACKET - 1]);
        packet
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_board_that_turns_left_says_what_the_data_sheet_says() {
        let board = ImuState {
            rate_rad_s: [0.0, 0.0, 1000_f64.to_radians()],
            force_m_s2: [0.0, 0.0, GRAVITY_M_S2],
            up: [0.0, 0.0, 1.0],
        };
        let [force, rate, angle] = packets(&board, 0.0);
        // 1 g is 2048 of 32768, 1000 degrees a second half of it; the sums by hand.
        assert_eq!(force, [0x55, 0x51, 0, 0, 0, 0, 0x00, 0x08, 0xC4, 0x09, 0x7B]);
        assert_eq!(rate, [0x55, 0x52, 0, 0, 0, 0, 0x00, 0x40, 0xC4, 0x09, 0xB4]);
        assert_eq!(angle, [0x55, 0x53, 0, 0, 0, 0, 0, 0, 0xC4, 0x09, 0x75]);
    }

    #[test]
    fn after_junk_and_a_damaged_packet_the_next_measurement_is_read() {
        let (sin, cos) = 0.3_f64.sin_cos();
        let board = ImuState {
            rate_rad_s: [0.5, -1.0, 2.0],
            force_m_s2: [1.0, -2.0, 9.0],
            up: [-sin * 0.6, sin * 0.8, cos],
        };
        let mut bytes = vec![7, HEAD, 3];
        let mut damaged = packets(&board, 1.0).concat();
        damaged[14] ^= 0xFF;
        bytes.extend(damaged);
        bytes.extend(packets(&board, 1.0).concat());
        let mut reader = Witmotion::new();
        let read: Vec<ImuState> = bytes.iter().filter_map(|byte| reader.hear(*byte)).collect();
        let [read] = read[..] else { panic!("{read:?}") };
        for axis in 0..3 {
            assert!((read.up[axis] - board.up[axis]).abs() < 1e-3, "{read:?}");
            assert!((read.rate_rad_s[axis] - board.rate_rad_s[axis]).abs() < 2e-3, "{read:?}");
            assert!((read.force_m_s2[axis] - board.force_m_s2[axis]).abs() < 5e-3, "{read:?}");
        }
    }
}
