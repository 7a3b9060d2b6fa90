//! Dynamixel Protocol 1 framing, which Feetech servos speak as well.
//!
//! `FF FF ID LEN INST params CHK`, LEN = params + 2, CHK = the complement of
//! the sum from ID on. A status packet has its error flags in place of INST.
//!
//! An echo of the host's own instruction is told from a status packet by its
//! bytes; that of a ping cannot be.

pub const PREFIX: usize = 4;

/// Appends an instruction packet to `out`.
pub fn encode(out: &mut Vec<u8>, id: u8, instruction: u8, params: &[u8]) {
    let start = out.len();
    out.extend([0xFF, 0xFF, id, params.len() as u8 + 2, instruction]);
    out.extend(params);
    out.push(checksum(&out[start + 2..]));
}

pub fn checksum(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte))
}

/// What a family means by the error flags of its answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ErrorFlags {
    /// Dynamixel: some bits are the servo's condition, others refuse the instruction.
    #[default]
    Dynamixel,
    /// Feetech: every bit is a condition, and nothing is ever refused.
    Conditions,
}

impl ErrorFlags {
    /// The error flags as this crate has them: the number of a refusal, and
    /// 0x80 where the servo reports its own condition (supply, angle, heat, load).
    pub fn error_of(self, flags: u8) -> u8 {
        let (number, conditions) = match self {
            Self::Conditions => (0, 0x3F),
            Self::Dynamixel if flags & 0x10 != 0 => (3, 0x27), // checksum
            Self::Dynamixel if flags & 0x40 != 0 => (2, 0x27), // instruction
            Self::Dynamixel if flags & 0x08 != 0 => (4, 0x27), // range
            Self::Dynamixel => (0, 0x27),
        };
        number | u8::from(flags & conditions != 0) << 7
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_ping_has_these_bytes() {
        let mut out = Vec::new();
        encode(&mut out, 1, 1, &[]);
        assert_eq!(out, [0xFF, 0xFF, 1, 2, 1, 0xFB]);
    }

    #[test]
    fn flags_become_refusals_and_alerts() {
        let error_of = |flags| ErrorFlags::Dynamixel.error_of(flags);
        assert_eq!(error_of(0), 0);
        assert_eq!(error_of(0x10), 3);
        assert_eq!(error_of(0x20), 0x80);
        assert_eq!(error_of(0x44), 0x82);
    }

    #[test]
    fn a_feetech_servo_reports_conditions_and_refuses_nothing() {
        assert_eq!(ErrorFlags::Conditions.error_of(0), 0);
        for bit in 0..6 {
            assert_eq!(ErrorFlags::Conditions.error_of(1 << bit), 0x80, "bit {bit}");
        }
    }
}
