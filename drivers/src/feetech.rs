//! Feetech STS servos: Protocol 1 framing, little-endian, signs as a bit.
//!
//! One Sync Read brings the fifteen bytes from position to current, with
//! voltage, temperature and the status flags.
//!
//! These servos have **no bus watchdog**: a servo that hears nothing more holds
//! its last goal.

use dynamixel2::instructions::instruction_id as instruction;

use crate::dialect::{
    Dialect, Identity, LimitRegisters, OwnLimits, Present, Registers, names_of, sign_magnitude,
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
const REGISTERS: Registers = Registers {
    torque: TORQUE,
    goal: GOAL,
    present: PRESENT,
    voltage_and_temperature: VOLTAGE_AND_TEMPERATURE,
};
/// Of everything that can be negative.
pub(crate) const SIGN_BIT: u32 = 15;

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
        REGISTERS
    }

    fn identify(
        &mut self,
        link: &mut Link,
        index: usize,
        _pinged: &[u8],
    ) -> Result<Identity, BusError> {
        match link.read_bytes(index, IDENTITY)?[..] {
            [firmware, _, _, low, high] => Ok(Identity::new([low, high], firmware)),
            _ => Ok(Identity::default()), // a read returns what was asked for
        }
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
            Some(&[low, high]) => sign_magnitude(u16::from_le_bytes([low, high]), SIGN_BIT),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_named() {
        assert_eq!(names_of(0x24, &CONDITIONS), "overheating, overload");
    }
}
