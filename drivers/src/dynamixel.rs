//! X series servos, and MX with Protocol 2.0.
//!
//! Everyone is read with a Fast Sync Read where all servos answer it (probed
//! once, when arming), else with a plain Sync Read; which one is said. A plain
//! one that the wire does not carry at the robot's rate is refused.

use dynamixel2::instructions::instruction_id as instruction;
use dynamixel2::instructions::packet_id::BROADCAST;

use crate::dialect::{Dialect, Identity, OwnLimits, Present, Registers};
use crate::error::BusError;
use crate::link::Link;
use crate::packet::Protocol;
use crate::rate::{bytes_hz, cycle_bytes};
use crate::register::{Register, hardware_error_names};
use crate::wire::Received;

/// Fast Sync Read; the `dynamixel2` crate does not know it.
const FAST_SYNC_READ: u8 = 0x8A;

const REGISTERS: Registers = Registers {
    torque: Register::TORQUE,
    goal: Register::GOAL_POSITION,
    present: Register::PRESENT,
    voltage_and_temperature: Register::VOLTAGE_AND_TEMPERATURE,
};

/// The dialect of Protocol 2.0.
pub struct DynamixelX {
    fast: bool,
    /// Of each servo, from its last ping.
    firmware: Vec<u8>,
}

impl DynamixelX {
    /// For a bus of `servos` servos.
    pub fn new(servos: usize) -> Self {
        Self {
            fast: false,
            firmware: vec![0; servos],
        }
    }

    /// One Fast Sync Read of everyone; stops at the first damage.
    fn fast_read(link: &mut Link, present: &mut [u8]) -> Result<Option<usize>, BusError> {
        let register = Register::PRESENT;
        let size = usize::from(register.size);
        // One packet for all: a part of it is no answer.
        link.begin_read();
        let count = link.read_request(register);
        if count == 0 {
            return Ok(None);
        }
        let length = 1 + count * (size + 4);
        link.send_request(FAST_SYNC_READ, length, register.name)?;
        let deadline = link.deadline(7 + length, 1);
        loop {
            match link.wire.receive(deadline, register.name)? {
                Received::Packet => {}
                Received::Corrupt | Received::Nothing => return Ok(None),
            }
            let packet = link.wire.packet();
            if packet.id != BROADCAST {
                continue;
            }
            let mut alert = None;
            let mut index = 0;
            for (error, id, data) in packet.blocks(size) {
                while link.aside.get(index) == Some(&true) {
                    index += 1;
                }
                let expected = link.servos.get(index);
                if expected.is_none_or(|servo| servo.id != id) || error & 0x7F != 0 {
                    return Ok(None);
                }
                present[index * size..][..size].copy_from_slice(data);
                link.answered[index] = true;
                alert = alert.or((error & 0x80 != 0).then_some(index));
                index += 1;
            }
            return Ok(alert);
        }
    }
}

/// The plain Sync Read it is, if the wire carries that as often as it is asked for.
fn fall_back(link: &Link, why: String, notes: &mut Vec<String>) -> Result<(), BusError> {
    let asked_hz = link.config.control_hz.unwrap_or(0.0);
    let (_, plain_bytes) = cycle_bytes(link.config.kind, link.servos.len());
    let limit_hz = bytes_hz(link.config.baud, plain_bytes);
    if asked_hz > limit_hz {
        return Err(BusError::PlainTooSlow {
            why,
            servos: link.servos.len(),
            baud: link.config.baud,
            limit_hz,
            bytes: plain_bytes,
            asked_hz,
        });
    }
    notes.push(format!("plain Sync Read: {why}"));
    Ok(())
}

impl Dialect for DynamixelX {
    fn protocol(&self) -> Protocol {
        Protocol::Dynamixel2
    }

    fn registers(&self) -> Registers {
        REGISTERS
    }

    fn identify(
        &mut self,
        _link: &mut Link,
        index: usize,
        pinged: &[u8],
    ) -> Result<Identity, BusError> {
        let &[low, high, firmware] = pinged else {
            return Ok(Identity::default()); // a ping returns what was asked for
        };
        self.firmware[index] = firmware;
        Ok(Identity::new([low, high], firmware))
    }

    fn condition(&self, link: &mut Link, index: usize) -> Result<Option<String>, BusError> {
        let flags = link.read(index, Register::HARDWARE_ERROR)? as u8;
        let words = || {
            let names = hardware_error_names(flags);
            format!("{names}; only a reboot or a power cycle clears it")
        };
        Ok((flags != 0).then(words))
    }

    fn own_limits(&self, link: &mut Link, index: usize) -> Result<OwnLimits, BusError> {
        let lowest_volts = link.read(index, Register::MIN_VOLTAGE)?;
        let highest_volts = link.read(index, Register::MAX_VOLTAGE)?;
        let lowest = link.read(index, Register::MIN_POSITION)? as u32 as i32;
        let highest = link.read(index, Register::MAX_POSITION)? as u32 as i32;
        let senses_current = link.servos[index].model.current_a_per_unit.is_some();
        Ok(OwnLimits {
            tenth_volts: (lowest_volts, highest_volts),
            celsius: link.read(index, Register::TEMPERATURE_LIMIT)?,
            ticks: (lowest, highest),
            current: match senses_current {
                true => Some(link.read(index, Register::CURRENT_LIMIT)?),
                false => None,
            },
            velocity: Some(link.read(index, Register::VELOCITY_LIMIT)?),
        })
    }

    fn set_up(
        &self,
        link: &mut Link,
        index: usize,
        notes: &mut Vec<String>,
    ) -> Result<(), BusError> {
        link.settle(index, Register::TORQUE, 0, notes)?;
        link.settle(index, Register::STATUS_RETURN_LEVEL, 2, notes)?;
        link.settle(index, Register::RETURN_DELAY, 0, notes)?;
        link.settle(index, Register::DRIVE_MODE, 0, notes)?;
        link.settle(index, Register::OPERATING_MODE, 3, notes)?;
        // A tripped watchdog refuses goals until it is cleared.
        link.write(index, Register::BUS_WATCHDOG, 0)?;
        link.settle(index, Register::PROFILE_ACCELERATION, 0, notes)?;
        link.settle(index, Register::PROFILE_VELOCITY, 0, notes)
    }

    fn arm_watchdog(&self, link: &mut Link, index: usize) -> Result<(), BusError> {
        let units = u64::from(link.config.watchdog_ms / 20);
        link.set(index, Register::BUS_WATCHDOG, units)
    }

    /// Fast Sync Read where the firmware has it and a probe succeeds.
    fn choose_read(&mut self, link: &mut Link, notes: &mut Vec<String>) -> Result<(), BusError> {
        self.fast = false;
        let old = link
            .servos
            .iter()
            .zip(&self.firmware)
            .position(|(servo, &version)| version < servo.model.fast_read_firmware);
        if let Some(index) = old {
            let servo = link.id_of(index);
            let why = format!(
                "{servo} runs firmware {}, Fast Sync Read needs {}",
                self.firmware[index], link.servos[index].model.fast_read_firmware
            );
            return fall_back(link, why, notes);
        }
        let mut probe = vec![0; usize::from(Register::PRESENT.size) * link.servos.len()];
        for _ in 0..link.tries() {
            Self::fast_read(link, &mut probe)?;
            if link.complete() {
                self.fast = true;
                return Ok(());
            }
        }
        let why = "the bus did not answer the Fast Sync Read probe";
        fall_back(link, why.into(), notes)
    }

    fn read_all(&mut self, link: &mut Link, present: &mut [u8]) -> Result<Option<usize>, BusError> {
        if self.fast {
            Self::fast_read(link, present)
        } else {
            link.plain_read(Register::PRESENT, present)
        }
    }

    fn parse(&self, bytes: &[u8]) -> Present {
        let &[c0, c1, v0, v1, v2, v3, p0, p1, p2, p3] = bytes else {
            return Present::default();
        };
        Present {
            ticks: i32::from_le_bytes([p0, p1, p2, p3]),
            velocity: i32::from_le_bytes([v0, v1, v2, v3]),
            current: i16::from_le_bytes([c0, c1]),
        }
    }

    fn reboot(&self, link: &mut Link, index: usize) -> Result<bool, BusError> {
        link.transfer(index, instruction::REBOOT, &[], 0, "reboot")?;
        Ok(true)
    }
}
