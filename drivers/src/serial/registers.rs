//! The registers that a family must name for the driver, and what they tell.

use crate::serial::register::Register;

/// What a bus needs of every family.
#[derive(Clone, Copy, Debug)]
pub struct Registers {
    /// 1 turns torque on.
    pub torque: Register,
    /// The goal position, ticks.
    pub goal: Register,
    /// Everything that is read each cycle, in a row.
    pub present: Register,
    /// What the tools for one servo need; `None` leaves the family out of scans.
    pub service: Option<ServiceRegisters>,
}

/// What `scan`, `ping` and `set-id` need, and the check of supply and temperature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServiceRegisters {
    /// The permanent bus id.
    pub id: Register,
    /// The highest id that a servo can be given.
    pub last_id: u8,
    /// The present position, ticks.
    pub position: Register,
    /// The supply in 0.1 V; the temperature stands right behind it.
    pub voltage: Register,
    /// The temperature in whole degrees Celsius.
    pub temperature: Register,
    /// What is wrong, as flags; `None` where only the flags of an answer tell.
    pub status: Option<Register>,
    /// 0 lets permanent memory be written.
    pub lock: Option<Register>,
}

impl ServiceRegisters {
    pub(crate) fn voltage_and_temperature(&self) -> Register {
        let size = self.voltage.size + self.temperature.size;
        Register::new(
            self.voltage.address,
            size,
            "present voltage and temperature",
        )
    }
}

/// What the present registers say, in the servo's units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PresentState {
    /// The position in encoder ticks.
    pub ticks: i32,
    /// The velocity with its sign.
    pub velocity: i32,
    /// Current, signed; 0 without a sensor.
    pub current: i16,
}

/// What a servo says it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// The vendor's number of its model.
    pub model_number: u16,
    /// The version of its firmware.
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
    /// The temperature at which it shuts down, Celsius.
    pub celsius: u64,
    /// Lowest and highest goal, ticks.
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
            [ref supply @ .., celsius] => Self {
                tenth_volts: register.value(supply),
                celsius: u64::from(celsius),
            },
            [] => Self::default(), // a read returns what was asked for
        }
    }
}

/// Bytes of one control cycle on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CycleBytes {
    /// With the family's quickest way to read everyone.
    pub fast: usize,
    /// With the plain one.
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
