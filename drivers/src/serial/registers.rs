//! The registers that a family must name for the driver, and what they tell.

use crate::serial::register::Register;

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Copy, Debug)]
pub struct Registers {
    /// 1 turns torque on.
    pub torque: Register,
    pub goal: Register,
    pub present: Register,
    /// What the tools for one servo need; `None` leaves the family out of scans.
    pub service: Option<ServiceRegisters>,
}

/// What `scan`, `ping`, `set-id` and `set-baud` need, and the check of supply and temperature.
#[allow(missing_docs)] // each field says its name
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServiceRegisters {
    pub id: Register,
    /// The rate, as [`crate::serial::ServoFamily::baud_code`] numbers it.
    pub baud: Register,
    /// A clock of the servo's own, which tells two servos with one id apart.
    pub clock: Option<Register>,
    pub last_id: u8,
    pub position: Register,
    /// The supply in 0.1 V; the temperature stands right behind it.
    pub voltage: Register,
    pub temperature: Register,
    /// What is wrong, as flags; `None` where only the flags of an answer tell.
    pub status: Option<Register>,
    /// 0 lets permanent memory be written.
    pub lock: Option<Register>,
}

impl ServiceRegisters {
    pub(crate) fn voltage_and_temperature(&self) -> Register {
        let size = self.voltage.size + self.temperature.size;
        Register::new(self.voltage.address, size, "present voltage and temperature")
    }
}

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PresentState {
    pub ticks: i32,
    pub velocity: i32,
    /// Current, signed; 0 without a sensor.
    pub current: i16,
}

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    pub model_number: u16,
    pub firmware: u8,
}

impl Identity {
    /// From the bytes of both, the model number's low byte first.
    pub fn new(model_number: [u8; 2], firmware: u8) -> Self {
        Self { model_number: u16::from_le_bytes(model_number), firmware }
    }
}

#[allow(missing_docs)] // units stand in the names
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OwnLimits {
    /// Lowest and highest supply, 0.1 V.
    pub tenth_volts: (u64, u64),
    pub celsius: u64,
    pub ticks: (i32, i32),
    /// Highest current, in the servo's units; `None` without a sensor.
    pub current: Option<u64>,
    /// Highest velocity, in the servo's units; `None` where it has no such limit.
    pub velocity: Option<u64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Measured {
    pub tenth_volts: u64,
    pub celsius: u64,
}

impl Measured {
    /// From the bytes of [`ServiceRegisters::voltage_and_temperature`].
    pub fn new(register: Register, bytes: &[u8]) -> Self {
        match *bytes {
            [ref supply @ .., celsius] => {
                Self { tenth_volts: register.value(supply), celsius: u64::from(celsius) }
            }
            [] => Self::default(), // a read returns what was asked for
        }
    }
}

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CycleBytes {
    pub fast: usize,
    pub plain: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn supply_is_all_bytes_but_the_last() {
        let read = |size, bytes: &[u8]| {
            let register = Register::new(0, size, "present voltage and temperature");
            let measured = Measured::new(register, bytes);
            (measured.tenth_volts, measured.celsius)
        };
        assert_eq!(read(2, &[120, 40]), (120, 40));
        assert_eq!(read(3, &[0x2C, 1, 40]), (300, 40));
    }
}
