//! A register of a servo's memory, and how its bytes become numbers and words.

use std::ops::Range;

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    pub address: u16,
    /// How many bytes, little-endian; more than 8 where several values are read in a row.
    pub size: u16,
    pub name: &'static str,
}

impl Register {
    /// A register of `size` bytes from `address` on.
    pub const fn new(address: u16, size: u16, name: &'static str) -> Self {
        Self { address, size, name }
    }

    /// A register of one byte.
    pub const fn byte(address: u16, name: &'static str) -> Self {
        Self::new(address, 1, name)
    }

    /// A register of two bytes.
    pub const fn word(address: u16, name: &'static str) -> Self {
        Self::new(address, 2, name)
    }

    /// The unsigned value in `bytes` (little-endian, at most 8 bytes).
    pub fn value(self, bytes: &[u8]) -> u64 {
        bytes.iter().rev().fold(0, |value, byte| value << 8 | u64::from(*byte))
    }

    /// Its bytes as a range of a memory that begins at address 0.
    pub fn range(self) -> Range<usize> {
        let start = usize::from(self.address);
        start..start + usize::from(self.size)
    }
}

/// A number as servos of Protocol 1 hold signed ones: magnitude below `sign_bit`,
/// which is set for a negative one. Bits above the sign mean something else.
pub fn sign_magnitude(word: u16, sign_bit: u32) -> i32 {
    let sign = 1 << sign_bit;
    let magnitude = i32::from(word & (sign - 1));
    if word & sign == 0 { magnitude } else { -magnitude }
}

/// The bits of `flags` in words.
pub(crate) fn names_of(flags: u8, names: &[(u8, &str)]) -> String {
    let set: Vec<&str> =
        names.iter().filter(|(bit, _)| flags & (1 << bit) != 0).map(|(_, name)| *name).collect();
    if set.is_empty() { format!("unknown flags {flags:#04x}") } else { set.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_are_a_bit() {
        let found = [5, 0x8005, 0x8000].map(|word| sign_magnitude(word, 15));
        assert_eq!(found, [5, -5, 0]);
        let found = [5, 0x0405, 0xFC05, 0xF805].map(|word| sign_magnitude(word, 10));
        assert_eq!(found, [5, -5, -5, 5]);
    }

    #[test]
    fn flags_are_named() {
        let names = [(2, "overheating"), (5, "overload")];
        assert_eq!(names_of(0x24, &names), "overheating, overload");
        assert_eq!(names_of(0x80, &names), "unknown flags 0x80");
    }
}
