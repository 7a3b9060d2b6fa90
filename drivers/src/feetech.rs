//! Feetech STS servos: Protocol 1 framing, little-endian, signs as a bit.
//!
//! A cycle is one Sync Write of every goal position and one Sync Read of the
//! fifteen bytes from position to current, which bring voltage, temperature and
//! the status flags along.
//!
//! These servos have **no bus watchdog**: a servo that hears nothing more holds
//! its last goal. Arming says so.
//!
//! Refused before torque: what [`crate::DynamixelBus`] refuses.

use servodance_types::JointState;

use crate::bus::{Bus, BusStats};
use crate::config::BusConfig;
use crate::error::BusError;
use crate::link::Link;
use crate::packet::Protocol;
use crate::register::Register;
use crate::servo::{Servo, check_cycle};

/// Bytes of [`PRESENT`].
const PRESENT_BYTES: usize = 15;

const fn register(address: u16, size: u16, name: &'static str) -> Register {
    Register {
        address,
        size,
        name,
    }
}

const MODEL: Register = register(3, 2, "model number");
const RETURN_DELAY: Register = register(7, 1, "return delay time");
const STATUS_LEVEL: Register = register(8, 1, "status return level");
const LOWEST: Register = register(9, 2, "minimum angle limit");
const HIGHEST: Register = register(11, 2, "maximum angle limit");
const HOTTEST: Register = register(13, 1, "temperature limit");
const MAX_VOLTAGE: Register = register(14, 1, "maximum voltage");
const MIN_VOLTAGE: Register = register(15, 1, "minimum voltage");
const MODE: Register = register(33, 1, "operating mode");
const TORQUE: Register = register(40, 1, "torque enable");
const ACCELERATION: Register = register(41, 1, "acceleration");
const GOAL: Register = register(42, 2, "goal position");
const GOAL_TIME: Register = register(44, 2, "goal time");
const GOAL_SPEED: Register = register(46, 2, "goal speed");
const LOCK: Register = register(55, 1, "EEPROM lock");
const PRESENT: Register = register(56, PRESENT_BYTES as u16, "present state");
const STATUS: Register = register(65, 1, "status");

/// One serial bus of Feetech STS servos.
pub struct FeetechBus {
    link: Link,
    armed: bool,
    /// Fifteen bytes a servo from the last read.
    present: Vec<u8>,
}

/// What the fifteen bytes say.
struct Present {
    ticks: i32,
    velocity: i32,
    current: i16,
    tenth_volts: u64,
    celsius: u64,
}

impl Present {
    fn parse(bytes: &[u8]) -> Self {
        let word = |at: usize| signed(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
        Self {
            ticks: word(0),
            velocity: word(2),
            tenth_volts: u64::from(bytes[6]),
            celsius: u64::from(bytes[7]),
            current: word(13) as i16,
        }
    }
}

/// Sign and magnitude: bit 15 is the sign.
fn signed(word: u16) -> i32 {
    let magnitude = i32::from(word & 0x7FFF);
    if word & 0x8000 == 0 {
        magnitude
    } else {
        -magnitude
    }
}

/// The status flags in words.
fn status_names(flags: u8) -> String {
    let names = [
        "voltage",
        "angle sensor",
        "overheating",
        "overcurrent",
        "angle",
        "overload",
    ];
    let set = names.iter().enumerate();
    let set: Vec<&str> = set
        .filter(|(bit, _)| flags & (1 << bit) != 0)
        .map(|(_, name)| *name)
        .collect();
    set.join(", ")
}

impl FeetechBus {
    /// Opens the port. Nothing is sent before [`Bus::arm`].
    pub fn open(port: &str, config: &BusConfig, servos: Vec<Servo>) -> Result<Self, BusError> {
        Ok(Self {
            present: vec![0; PRESENT_BYTES * servos.len()],
            link: Link::open(port, config, servos, Protocol::Protocol1)?,
            armed: false,
        })
    }

    fn present(&self, index: usize) -> Present {
        Present::parse(&self.present[index * PRESENT_BYTES..][..PRESENT_BYTES])
    }

    /// Refuses a servo that should not get torque now.
    fn check_fit(&mut self, index: usize) -> Result<(), BusError> {
        let number = self.link.read(index, MODEL)? as u16;
        self.link.check_model(index, number)?;
        self.check_status(index)?;
        let present = self.present(index);
        let link = &mut self.link;
        let lowest = link.read(index, MIN_VOLTAGE)?;
        let highest = link.read(index, MAX_VOLTAGE)?;
        link.check_voltage(index, present.tenth_volts, lowest, highest)?;
        let hottest = link.read(index, HOTTEST)?;
        link.check_temperature(index, present.celsius, hottest)?;
        let lowest = link.read(index, LOWEST)? as i32;
        // Both limits zero is a servo without limits.
        let highest = match link.read(index, HIGHEST)? as i32 {
            0 if lowest == 0 => 4095,
            highest => highest,
        };
        link.check_goal_range(index, (lowest, highest))
    }

    fn check_status(&mut self, index: usize) -> Result<(), BusError> {
        let flags = self.link.read(index, STATUS)? as u8;
        if flags == 0 {
            return Ok(());
        }
        Err(BusError::Hardware {
            servo: self.link.id_of(index),
            flags: status_names(flags),
        })
    }

    /// Torque off, then the settings this driver relies on.
    fn set_up(&mut self, index: usize, notes: &mut Vec<String>) -> Result<(), BusError> {
        let link = &mut self.link;
        link.settle(index, TORQUE, 0, notes)?;
        link.write(index, LOCK, 0)?;
        link.settle(index, STATUS_LEVEL, 1, notes)?;
        link.settle(index, RETURN_DELAY, 0, notes)?;
        link.settle(index, MODE, 0, notes)?;
        link.write(index, LOCK, 1)?;
        // No profile: the host shapes the motion.
        link.settle(index, ACCELERATION, 0, notes)?;
        link.settle(index, GOAL_TIME, 0, notes)?;
        link.settle(index, GOAL_SPEED, 0, notes)
    }

    /// Everything between a silent bus and torque.
    fn check_all(&mut self) -> Result<Vec<String>, BusError> {
        let mut notes: Vec<String> = self.link.wire.latency_note().into_iter().collect();
        notes
            .push("these servos have no watchdog: without a host they hold their last goal".into());
        self.link.ping_all()?;
        self.read_present()?;
        for index in 0..self.link.servos.len() {
            self.check_fit(index)?;
            self.set_up(index, &mut notes)?;
        }
        Ok(notes)
    }

    fn torque_on(&mut self) -> Result<Vec<JointState>, BusError> {
        self.read_present()?;
        for index in 0..self.link.servos.len() {
            let goal = self.link.holding_goal(index, self.present(index).ticks)?;
            self.link.set(index, GOAL, u64::from(goal as u16))?;
        }
        // From here on torque may be on, whatever goes wrong.
        self.armed = true;
        self.link.sync_write(TORQUE, |_, _| 1)?;
        for index in 0..self.link.servos.len() {
            self.link.expect(index, TORQUE, 1)?;
        }
        self.read_present()?;
        let mut states = vec![JointState::default(); self.link.servos.len()];
        self.copy_states(&mut states);
        Ok(states)
    }

    /// Reads everyone's state, with retries.
    fn read_present(&mut self) -> Result<(), BusError> {
        self.link.answered.fill(false);
        let damaged = self.link.wire.stats.crc_errors;
        for attempt in 0..self.link.tries() {
            self.link.wire.stats.retries += u64::from(attempt > 0);
            let alert = self.link.plain_read(PRESENT, &mut self.present)?;
            alert.map_or(Ok(()), |index| self.check_status(index))?;
            if self.link.complete() {
                return Ok(());
            }
        }
        let corrupt = self.link.wire.stats.crc_errors > damaged;
        Err(self.link.name_the_silent(corrupt))
    }

    fn copy_states(&self, states: &mut [JointState]) {
        for (index, (state, servo)) in states.iter_mut().zip(&self.link.servos).enumerate() {
            let present = self.present(index);
            *state = servo.state(present.ticks, present.velocity, present.current);
        }
    }
}

impl Bus for FeetechBus {
    fn servos(&self) -> &[Servo] {
        &self.link.servos
    }

    fn prepare(&mut self) -> Result<Vec<String>, BusError> {
        self.check_all()
    }

    fn engage(&mut self) -> Result<Vec<JointState>, BusError> {
        self.torque_on().inspect_err(|_| {
            if self.armed {
                // The first error is the one to report; drop tries again.
                let _ = self.disarm();
            }
        })
    }

    fn cycle(&mut self, targets_rad: &[f64], states: &mut [JointState]) -> Result<(), BusError> {
        if !self.armed {
            return Err(BusError::NotArmed);
        }
        check_cycle(&self.link.servos, targets_rad, states.len())?;
        self.link
            .sync_write(GOAL, |index, servo| servo.goal_ticks(targets_rad[index]))?;
        self.read_present()?;
        self.copy_states(states);
        self.link.wire.stats.cycles += 1;
        Ok(())
    }

    fn disarm(&mut self) -> Result<(), BusError> {
        self.link.torque_off(TORQUE)?;
        self.armed = false;
        Ok(())
    }

    fn is_armed(&self) -> bool {
        self.armed
    }

    fn stats(&self) -> BusStats {
        self.link.wire.stats
    }
}

impl Drop for FeetechBus {
    fn drop(&mut self) {
        if !self.armed {
            return;
        }
        if let Err(error) = self.disarm() {
            eprintln!("{error}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_are_a_bit() {
        assert_eq!((signed(5), signed(0x8005), signed(0x8000)), (5, -5, 0));
    }

    #[test]
    fn flags_are_named() {
        assert_eq!(status_names(0x24), "overheating, overload");
    }
}
