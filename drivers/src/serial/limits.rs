//! The limits in a servo's own memory where they are single registers.

use crate::error::BusResult;
use crate::serial::client::ServoClient;
use crate::serial::register::Register;
use crate::serial::registers::OwnLimits;

/// Where a servo of Protocol 1 keeps its own limits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LimitRegisters {
    pub volts: (Register, Register),
    pub celsius: Register,
    pub ticks: (Register, Register),
}

impl LimitRegisters {
    pub fn read(&self, client: &mut ServoClient, index: usize) -> BusResult<OwnLimits> {
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
