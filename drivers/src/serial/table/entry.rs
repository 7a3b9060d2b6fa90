//! One register as the tools show and write it: who may write it, its range, what its
//! number means.

use crate::serial::register::{Register, sign_magnitude};
use crate::serial::table::measure::Measure;

/// What the tools may do with a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read alone: measured, or none of a user's business.
    Read,
    /// Written at any time, lost when the servo is switched off.
    Ram,
    /// Kept for good; written while torque is off.
    Eeprom,
    /// A goal: `dance` and `jog` give those, inside the limits of the joint.
    Goal,
    /// Id and rate: `set-id` and `set-baud` look where the servo answers then.
    Address,
}

/// How a register holds a number below zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Not at all.
    None,
    /// As the two's complement.
    Complement,
    /// As a magnitude below this bit, which is set.
    Bit(u32),
}

/// A row of a register table.
#[derive(Clone, Copy, Debug)]
pub struct TableEntry {
    /// Address, size, name in messages.
    pub register: Register,
    /// Who may write it.
    pub access: Access,
    /// How it holds a number below zero.
    pub sign: Sign,
    /// What its number means.
    pub measure: Measure,
    /// Lowest and highest number that may be written.
    pub range: (i64, i64),
    /// Bits that stay 0: they would turn torque on, at once or by themselves later.
    pub torque_bits: i64,
}

impl PartialEq for TableEntry {
    /// Two rows are the same if they are about the same register.
    fn eq(&self, other: &Self) -> bool {
        self.register == other.register
    }
}

impl TableEntry {
    const fn new(register: Register, access: Access, range: (i64, i64)) -> Self {
        let measure = Measure::Plain;
        Self { register, access, sign: Sign::None, measure, range, torque_bits: 0 }
    }

    pub(crate) const fn read(register: Register) -> Self {
        Self::new(register, Access::Read, (0, 0))
    }

    pub(crate) const fn ram(register: Register, lowest: i64, highest: i64) -> Self {
        Self::new(register, Access::Ram, (lowest, highest))
    }

    pub(crate) const fn eeprom(register: Register, lowest: i64, highest: i64) -> Self {
        Self::new(register, Access::Eeprom, (lowest, highest))
    }

    pub(crate) const fn goal(register: Register) -> Self {
        Self::new(register, Access::Goal, (0, 0))
    }

    pub(crate) const fn address(register: Register) -> Self {
        Self::new(register, Access::Address, (0, 0))
    }

    pub(crate) const fn signed(mut self) -> Self {
        self.sign = Sign::Complement;
        self
    }

    pub(crate) const fn sign_bit(mut self, bit: u32) -> Self {
        self.sign = Sign::Bit(bit);
        self
    }

    pub(crate) const fn measured(mut self, measure: Measure) -> Self {
        self.measure = measure;
        self
    }

    pub(crate) const fn torque_bits(mut self, bits: i64) -> Self {
        self.torque_bits = bits;
        self
    }

    /// Its name as it is typed: `present_position`.
    pub fn name(&self) -> String {
        self.register.name.to_lowercase().replace(' ', "_")
    }

    /// The number in its bits.
    pub fn decode(&self, bits: u64) -> i64 {
        let unused = 64 - 8 * u32::from(self.register.size).min(8);
        match self.sign {
            Sign::None => bits as i64,
            Sign::Complement => ((bits << unused) as i64) >> unused,
            Sign::Bit(bit) => i64::from(sign_magnitude(bits as u16, bit)),
        }
    }

    /// The bits of a number in its range.
    pub(crate) fn encode(&self, value: i64) -> u64 {
        let unused = 64 - 8 * u32::from(self.register.size).min(8);
        match self.sign {
            Sign::Bit(bit) => value.unsigned_abs() | u64::from(value < 0) << bit,
            Sign::None | Sign::Complement => (value as u64) << unused >> unused,
        }
    }
}
