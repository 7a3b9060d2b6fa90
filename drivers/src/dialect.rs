//! What one family of serial servos does differently from the others.
//!
//! [`crate::SerialBus`] knows how a bus is checked, armed, cycled and left; a
//! dialect knows the family's registers and instructions.

use crate::error::BusError;
use crate::link::Link;
use crate::packet::Protocol;
use crate::register::Register;

/// The registers that every family has, each at its own place.
#[derive(Clone, Copy, Debug)]
pub struct Registers {
    /// 1 is torque on.
    pub torque: Register,
    /// Where to go, ticks.
    pub goal: Register,
    /// All that is read each cycle, in a row.
    pub present: Register,
    /// Supply in 0.1 V, then a byte of temperature in Celsius.
    pub voltage_and_temperature: Register,
}

/// What the present registers say, in the servo's units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Present {
    /// Position.
    pub ticks: i32,
    /// Velocity, signed.
    pub velocity: i32,
    /// Current, signed; 0 without a sensor.
    pub current: i16,
}

/// What a servo says it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Its model number.
    pub model_number: u16,
    /// Its firmware version.
    pub firmware: u8,
}

impl Identity {
    /// From the bytes of both, the model number's low byte first.
    pub fn new(model_number: [u8; 2], firmware: u8) -> Self {
        Self {
            model_number: u16::from_le_bytes(model_number),
            firmware,
        }
    }
}

/// A servo's own limits, as its memory holds them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OwnLimits {
    /// Lowest and highest supply, 0.1 V.
    pub tenth_volts: (u64, u64),
    /// Where it shuts down, Celsius.
    pub celsius: u64,
    /// Lowest and highest goal, ticks.
    pub ticks: (i32, i32),
    /// Highest current, in the servo's units; `None` without a sensor.
    pub current: Option<u64>,
    /// Highest velocity, in the servo's units; `None` where it has no such limit.
    pub velocity: Option<u64>,
}

/// Supply and temperature as measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Measured {
    /// Supply, 0.1 V.
    pub tenth_volts: u64,
    /// Temperature, Celsius.
    pub celsius: u64,
}

impl Measured {
    /// From the bytes of [`Registers::voltage_and_temperature`].
    pub fn new(register: Register, bytes: &[u8]) -> Self {
        match *bytes {
            [ref supply @ .., celsius] => Self {
                tenth_volts: register.value(supply),
                celsius: u64::from(celsius),
            },
            [] => Self::default(), // a read returns what was asked for
        }
    }
}

/// Where a servo of Protocol 1 keeps its own limits.
#[derive(Clone, Copy, Debug)]
pub struct LimitRegisters {
    /// Lowest and highest supply.
    pub volts: (Register, Register),
    /// Where it shuts down.
    pub celsius: Register,
    /// Lowest and highest goal.
    pub ticks: (Register, Register),
}

impl LimitRegisters {
    /// The limits of one servo, as its memory holds them.
    pub fn read(&self, link: &mut Link, index: usize) -> Result<OwnLimits, BusError> {
        let mut pair = |(low, high)| Ok((link.read(index, low)?, link.read(index, high)?));
        let tenth_volts = pair(self.volts)?;
        let (lowest, highest) = pair(self.ticks)?;
        Ok(OwnLimits {
            tenth_volts,
            celsius: link.read(index, self.celsius)?,
            ticks: (lowest as i32, highest as i32),
            current: None,
            velocity: None,
        })
    }
}

/// One family of servos.
pub trait Dialect: Send {
    /// Its framing.
    fn protocol(&self) -> Protocol;

    /// Its registers.
    fn registers(&self) -> Registers;

    /// What the servo that answered a ping with `pinged` is.
    fn identify(
        &mut self,
        link: &mut Link,
        index: usize,
        pinged: &[u8],
    ) -> Result<Identity, BusError>;

    /// Why the servo cannot stop by itself when the host goes silent; `None`
    /// where it can.
    fn lacks_watchdog(&self) -> Option<&'static str> {
        None
    }

    /// What the servo has against itself, in words; `None` when it is well.
    fn condition(&self, link: &mut Link, index: usize) -> Result<Option<String>, BusError>;

    /// The limits in its memory.
    fn own_limits(&self, link: &mut Link, index: usize) -> Result<OwnLimits, BusError>;

    /// Supply and temperature: one exchange.
    fn measure(&self, link: &mut Link, index: usize) -> Result<Measured, BusError> {
        let register = self.registers().voltage_and_temperature;
        let bytes = link.read_bytes(index, register)?;
        Ok(Measured::new(register, &bytes))
    }

    /// Torque off, then the settings that the driver relies on.
    fn set_up(
        &self,
        link: &mut Link,
        index: usize,
        notes: &mut Vec<String>,
    ) -> Result<(), BusError>;

    /// Arms the servo's own watchdog and reads it back.
    fn arm_watchdog(&self, _link: &mut Link, _index: usize) -> Result<(), BusError> {
        Ok(())
    }

    /// Finds the best way to read everyone.
    fn choose_read(&mut self, _link: &mut Link, _notes: &mut Vec<String>) -> Result<(), BusError> {
        Ok(())
    }

    /// Asks those who have not answered for their present registers, once.
    /// The first servo that raised its alert bit.
    fn read_all(&mut self, link: &mut Link, present: &mut [u8]) -> Result<Option<usize>, BusError>;

    /// What one servo's present registers say.
    fn parse(&self, bytes: &[u8]) -> Present;

    /// Restarts a servo that has shut itself down; it is deaf for a while.
    /// False where there is no such instruction.
    fn reboot(&self, _link: &mut Link, _index: usize) -> Result<bool, BusError> {
        Ok(false)
    }
}

/// A number as Protocol 1 servos hold signed ones: magnitude below `sign_bit`,
/// which is set for a negative one. Bits above it mean something else.
pub fn sign_magnitude(word: u16, sign_bit: u32) -> i32 {
    let sign = 1 << sign_bit;
    let magnitude = i32::from(word & (sign - 1));
    if word & sign == 0 {
        magnitude
    } else {
        -magnitude
    }
}

/// Bits of `flags` in words, `other` if none of them has a name.
pub fn names_of(flags: u8, names: &[(u8, &str)]) -> String {
    let set: Vec<&str> = names
        .iter()
        .filter(|(bit, _)| flags & (1 << bit) != 0)
        .map(|(_, name)| *name)
        .collect();
    if set.is_empty() {
        format!("unknown flags {flags:#04x}")
    } else {
        set.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::register::register;

    #[test]
    fn signs_are_a_bit() {
        let found = [5, 0x8005, 0x8000].map(|word| sign_magnitude(word, 15));
        assert_eq!(found, [5, -5, 0]);
        let found = [5, 0x0405, 0xFC05, 0xF805].map(|word| sign_magnitude(word, 10));
        assert_eq!(found, [5, -5, -5, 5]);
    }

    #[test]
    fn supply_is_all_bytes_but_the_last() {
        let read = |size, bytes: &[u8]| {
            let register = register(0, size, "present voltage and temperature");
            let measured = Measured::new(register, bytes);
            (measured.tenth_volts, measured.celsius)
        };
        assert_eq!(read(2, &[120, 40]), (120, 40));
        assert_eq!(read(3, &[0x2C, 1, 40]), (300, 40));
    }
}
