//! AX servos, and MX with Protocol 1.0.
//!
//! There is no Sync Read. MX servos are read with one Bulk Read; as soon as one
//! AX is on the bus, each servo is asked by itself, which costs its adapter's
//! delay every time. There is no bus watchdog and no reboot.
//!
//! A servo that shuts itself down says so in every answer, and its torque limit
//! drops to zero until it is written again.

use dynamixel2::instructions::instruction_id as instruction;

use crate::dialect::{
    Dialect, Identity, LimitRegisters, OwnLimits, Present, Registers, names_of, sign_magnitude,
};
use crate::error::BusError;
use crate::link::Link;
use crate::packet::Protocol;
use crate::register::{Register, register};

const IDENTITY: Register = register(0, 3, "model number and firmware");
const LIMITS: LimitRegisters = LimitRegisters {
    volts: (
        register(12, 1, "lowest voltage"),
        register(13, 1, "highest voltage"),
    ),
    celsius: register(11, 1, "temperature limit"),
    ticks: (
        register(6, 2, "clockwise angle limit"),
        register(8, 2, "counterclockwise angle limit"),
    ),
};
const RETURN_DELAY: Register = register(5, 1, "return delay time");
const MAX_TORQUE: Register = register(14, 2, "maximum torque");
const STATUS_LEVEL: Register = register(16, 1, "status return level");
const TORQUE: Register = register(24, 1, "torque enable");
const GOAL: Register = register(30, 2, "goal position");
const SPEED: Register = register(32, 2, "moving speed");
const TORQUE_LIMIT: Register = register(34, 2, "torque limit");
/// Position, speed, load, voltage and temperature.
const PRESENT: Register = register(36, 8, "present state");
const VOLTAGE_AND_TEMPERATURE: Register = register(42, 2, "present voltage and temperature");
/// MX only.
const TORQUE_MODE: Register = register(70, 1, "torque control mode");
const ACCELERATION: Register = register(73, 1, "goal acceleration");
const REGISTERS: Registers = Registers {
    torque: TORQUE,
    goal: GOAL,
    present: PRESENT,
    voltage_and_temperature: VOLTAGE_AND_TEMPERATURE,
};
/// Of speeds; set for clockwise, which is downwards.
const SIGN_BIT: u32 = 10;

/// What a servo has against itself, by the bits of its error byte.
const CONDITIONS: [(u8, &str); 4] = [
    (0, "input voltage"),
    (1, "angle limit"),
    (2, "overheating"),
    (5, "overload"),
];

/// The dialect of Protocol 1.0.
pub struct Dynamixel1;

impl Dialect for Dynamixel1 {
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
            [low, high, firmware] => Ok(Identity::new([low, high], firmware)),
            _ => Ok(Identity::default()), // a read returns what was asked for
        }
    }

    fn lacks_watchdog(&self) -> Option<&'static str> {
        Some("has no watchdog in Protocol 1.0")
    }

    fn condition(&self, link: &mut Link, index: usize) -> Result<Option<String>, BusError> {
        link.ping(index)?;
        let flags = link.flags & CONDITIONS.iter().fold(0, |mask, (bit, _)| mask | 1 << bit);
        Ok((flags != 0).then(|| names_of(flags, &CONDITIONS)))
    }

    fn own_limits(&self, link: &mut Link, index: usize) -> Result<OwnLimits, BusError> {
        LIMITS.read(link, index)
    }

    fn set_up(
        &self,
        link: &mut Link,
        index: usize,
        notes: &mut Vec<String>,
    ) -> Result<(), BusError> {
        // Answers to writes first: without them nothing can be read back.
        if link.read(index, STATUS_LEVEL)? != 2 {
            link.write_unheard(index, STATUS_LEVEL, 2)?;
            link.expect(index, STATUS_LEVEL, 2)?;
        }
        link.settle(index, TORQUE, 0, notes)?;
        link.settle(index, RETURN_DELAY, 0, notes)?;
        let most = link.read(index, MAX_TORQUE)?;
        link.settle(index, TORQUE_LIMIT, most, notes)?;
        // No profile: the host shapes the motion.
        link.settle(index, SPEED, 0, notes)?;
        if link.servos[index].model.bulk_read {
            link.settle(index, TORQUE_MODE, 0, notes)?;
            link.settle(index, ACCELERATION, 0, notes)?;
        }
        Ok(())
    }

    fn choose_read(&mut self, link: &mut Link, notes: &mut Vec<String>) -> Result<(), BusError> {
        if let Some(index) = asked_singly(link) {
            let servo = link.id_of(index);
            let model = link.servos[index].model.name;
            notes.push(format!(
                "a read for each servo: {servo} is an {model}, which knows no Bulk Read"
            ));
        }
        Ok(())
    }

    fn read_all(&mut self, link: &mut Link, present: &mut [u8]) -> Result<Option<usize>, BusError> {
        if asked_singly(link).is_none() {
            let count = link.bulk_request(PRESENT);
            return link.collect(instruction::BULK_READ, count, PRESENT, present);
        }
        let size = usize::from(PRESENT.size);
        let mut alert = None;
        for index in 0..link.servos.len() {
            if link.answered[index] {
                continue;
            }
            match link.once(|link| link.read_bytes(index, PRESENT)) {
                Ok(bytes) => {
                    present[index * size..][..size].copy_from_slice(&bytes);
                    link.answered[index] = true;
                    alert = alert.or((link.flags & 0x27 != 0).then_some(index));
                }
                Err(BusError::Silent { .. } | BusError::Corrupt { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(alert)
    }

    fn parse(&self, bytes: &[u8]) -> Present {
        let &[p0, p1, s0, s1, ..] = bytes else {
            return Present::default();
        };
        Present {
            ticks: i32::from(u16::from_le_bytes([p0, p1])),
            velocity: sign_magnitude(u16::from_le_bytes([s0, s1]), SIGN_BIT),
            current: 0,
        }
    }
}

/// The first servo that cannot be read with the others.
fn asked_singly(link: &Link) -> Option<usize> {
    link.servos.iter().position(|servo| !servo.model.bulk_read)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn present_registers_are_read_as_the_vendor_says() {
        let present = Dynamixel1.parse(&[0x00, 0x02, 0x05, 0x04, 0, 0, 120, 40]);
        assert_eq!((present.ticks, present.velocity), (512, -5));
    }
}
