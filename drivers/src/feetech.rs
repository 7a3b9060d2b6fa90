//! Feetech STS servos: Protocol 1 framing, little-endian, signs as a bit.
//!
//! One Sync Read brings the fifteen bytes from position to current, with
//! voltage, temperature and the status flags.
//!
//! These servos have **no bus watchdog**: a servo that hears nothing more holds
//! its last goal.

use dynamixel2::instructions::instruction_id as instruction;

use crate::dialect::{
    Dialect, Identity, LimitRegisters, Measured, OwnLimits, Present, Registers, names_of,
};
use crate::error::BusError;
use crate::link::Link;
use crate::packet::Protocol;
use crate::register::{Register, register};

const IDENTITY: Register = register(0, 5, "firmware and model number");
const LIMITS: LimitRegisters = LimitRegisters {
    volts: (
        register(15, 1, "minimum voltage"),
        register(14, 1, "maximum voltage"),
    ),
    celsius: register(13, 1, "temperature limit"),
    ticks: (
        register(9, 2, "minimum angle limit"),
        register(11, 2, "maximum angle limit"),
    ),
};
const RETURN_DELAY: Register = register(7, 1, "return delay time");
const STATUS_LEVEL: Register = register(8, 1, "status return level");
const MODE: Register = register(33, 1, "operating mode");
const TORQUE: Register = register(40, 1, "torque enable");
const ACCELERATION: Register = register(41, 1, "acceleration");
const GOAL: Register = register(42, 2, "goal position");
const GOAL_TIME: Register = register(44, 2, "goal time");
const GOAL_SPEED: Register = register(46, 2, "goal speed");
const LOCK: Register = register(55, 1, "EEPROM lock");
const PRESENT: Register = register(56, 15, "present state");
const VOLTAGE_AND_TEMPERATURE: Register = register(62, 2, "present voltage and temperature");
const STATUS: Register = register(65, 1, "status");

/// What a servo has against itself, by the bits of its status.
pub(crate) const CONDITIONS: [(u8, &str); 6] = [
    (0, "voltage"),
    (1, "angle sensor"),
    (2, "overheating"),
    (3, "overcurrent"),
    (4, "angle"),
    (5, "overload"),
];

/// The dialect of STS servos.
pub struct FeetechSts;

impl Dialect for FeetechSts {
    fn protocol(&self) -> Protocol {
        Protocol::Protocol1
    }

    fn registers(&self) -> Registers {
        Registers {
            torque: TORQUE,
            goal: GOAL,
            present: PRESENT,
        }
    }

    fn identify(
        &mut self,
        link: &mut Link,
        index: usize,
        _pinged: &[u8],
    ) -> Result<Identity, BusError> {
        let bytes = link.read_bytes(index, IDENTITY)?;
        let &[firmware, _, _, low, high] = &bytes[..] else {
            return Ok(Identity::default()); // a read returns what was asked for
        };
        Ok(Identity {
            model_number: u16::from_le_bytes([low, high]),
            firmware,
        })
    }

    fn lacks_watchdog(&self) -> Option<&'static str> {
        Some("has no watchdog")
    }

    fn condition(&self, link: &mut Link, index: usize) -> Result<Option<String>, BusError> {
        let flags = link.read(index, STATUS)? as u8;
        Ok((flags != 0).then(|| names_of(flags, &CONDITIONS)))
    }

    fn own_limits(&self, link: &mut Link, index: usize) -> Result<OwnLimits, BusError> {
        let limits = LIMITS.read(link, index)?;
        // Both limits zero is a servo without limits.
        let ticks = match limits.ticks {
            (0, 0) => (0, 4095),
            ticks => ticks,
        };
        Ok(OwnLimits { ticks, ..limits })
    }

    fn measure(&self, link: &mut Link, index: usize) -> Result<Measured, BusError> {
        let bytes = link.read_bytes(index, VOLTAGE_AND_TEMPERATURE)?;
        Ok(Measured::from_bytes(&bytes))
    }

    fn set_up(
        &self,
        link: &mut Link,
        index: usize,
        notes: &mut Vec<String>,
    ) -> Result<(), BusError> {
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

    fn read_all(&mut self, link: &mut Link, present: &mut [u8]) -> Result<Option<usize>, BusError> {
        link.plain_read(PRESENT, present)
    }

    fn parse(&self, bytes: &[u8]) -> Present {
        let word = |at: usize| match bytes.get(at..at + 2) {
            Some(&[low, high]) => signed(u16::from_le_bytes([low, high])),
            _ => 0,
        };
        Present {
            ticks: word(0),
            velocity: word(2),
            current: word(13) as i16,
        }
    }

    fn reboot(&self, link: &mut Link, index: usize) -> Result<bool, BusError> {
        link.transfer(index, instruction::REBOOT, &[], 0, "reboot")?;
        Ok(true)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_are_a_bit() {
        assert_eq!((signed(5), signed(0x8005), signed(0x8000)), (5, -5, 0));
    }

    #[test]
    fn flags_are_named() {
        assert_eq!(names_of(0x24, &CONDITIONS), "overheating, overload");
    }
}
