//! The limits in a servo's own memory where they are single registers.

use crate::error::BusError;
use crate::serial::client::ServoClient;
use crate::serial::register::Register;
use crate::serial::registers::OwnLimits;

/// Where a servo of Protocol 1 keeps its own limits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LimitRegisters {
    /// Lowest and highest supply.
    pub volts: (Register, Register),
    pub celsius: Register,
    /// Lowest and highest goal.
    pub ticks: (Register, Register),
}

impl LimitRegisters {
    /// The limits of one servo.
    pub fn read(&self, client: &mut ServoClient, index: usize) -> Result<OwnLimits, BusError> {
        let mut pair = |(low, high)| Ok((client.read(index, low)?, client.read(index, high)?));
        let tenth_volts = pair(self.volts)?;
        let (lowest, highest) = pair(self.ticks)?;
        Ok(OwnLimits {
            tenth_volts,
            celsius: client.read(index, self.celsius)?,
            ticks: (lowest as i32, highest as i32),
            current: None,
            velocity: None,
        })
    }
}
