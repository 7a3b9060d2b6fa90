//! What one CAN FD frame of the moteus register protocol carries: writes, reads and replies of
//! registers, one after the other.
//!
//! ```text
//! 00 | kind << 2 | count   write: the register, then the values    (10: read, 20: reply)
//! 30, 31                   a refused write or read: register, code
//! 50                       nothing; fills a frame up to a length that CAN FD knows
//! ```
//!
//! A count of 0 says that the count follows. Counts and registers are varuints: seven bits a
//! byte, the lowest first.

pub use super::kind::Kind;
use super::registers::scale;
use crate::can::transport::CanFrame;

const WRITE: u8 = 0x00;
const READ: u8 = 0x10;
const REPLY: u8 = 0x20;
const READ_ERROR: u8 = 0x31;
pub const NOTHING: u8 = 0x50;

impl Kind {
    /// The value of a register in these bytes.
    fn decode(self, register: u16, bytes: &[u8]) -> Option<f64> {
        let (raw, least) = match *bytes {
            [a] => (i32::from(a as i8), i32::from(i8::MIN)),
            [a, b] => (i32::from(i16::from_le_bytes([a, b])), i32::from(i16::MIN)),
            [a, b, c, d] if self == Self::F32 => {
                return Some(f64::from(f32::from_le_bytes([a, b, c, d])));
            }
            [a, b, c, d] => (i32::from_le_bytes([a, b, c, d]), i32::MIN),
            _ => return None,
        };
        Some(if raw == least { f64::NAN } else { f64::from(raw) * scale(register, self) })
    }

    fn encode(self, register: u16, value: f64, out: &mut Vec<u8>) {
        // Towards zero and as far as the number goes, as the controllers have it.
        let counted = value / scale(register, self);
        match (self, value.is_nan()) {
            (Self::F32, _) => out.extend((value as f32).to_le_bytes()),
            (Self::I8, true) => out.push(i8::MIN as u8),
            (Self::I16, true) => out.extend(i16::MIN.to_le_bytes()),
            (Self::I32, true) => out.extend(i32::MIN.to_le_bytes()),
            (Self::I8, false) => out.push((counted as i8).max(-i8::MAX) as u8),
            (Self::I16, false) => out.extend((counted as i16).max(-i16::MAX).to_le_bytes()),
            (Self::I32, false) => out.extend((counted as i32).max(-i32::MAX).to_le_bytes()),
        }
    }
}

/// One thing that a frame says.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)] // the names say it
pub enum Said {
    Write { register: u16, value: f64 },
    Read { register: u16, kind: Kind, count: u16 },
    Reply { register: u16, value: f64 },
}

/// Goes through what a frame says. What is no protocol ends it.
#[derive(Clone, Debug)]
pub struct Saying<'a> {
    rest: &'a [u8],
    /// Values that still follow: of a reply or a write, kind, next register, how many.
    values: Option<(bool, Kind, u16, u16)>,
}

impl<'a> Saying<'a> {
    /// From the data of a frame.
    pub fn of(data: &'a [u8]) -> Self {
        Self { rest: data, values: None }
    }

    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(*first)
    }

    fn varuint(&mut self) -> Option<u16> {
        let mut sum = 0;
        for shift in [0, 7, 14] {
            let byte = self.byte()?;
            sum |= u32::from(byte & 0x7F) << shift;
            if byte & 0x80 == 0 {
                return u16::try_from(sum).ok();
            }
        }
        None
    }
}

impl Iterator for Saying<'_> {
    type Item = Said;

    fn next(&mut self) -> Option<Said> {
        loop {
            if let Some((is_reply, kind, register, left)) = self.values.take() {
                let (bytes, rest) = self.rest.split_at_checked(kind.size())?;
                self.rest = rest;
                let value = kind.decode(register, bytes)?;
                self.values = (left > 1).then_some((is_reply, kind, register + 1, left - 1));
                return Some(match is_reply {
                    true => Said::Reply { register, value },
                    false => Said::Write { register, value },
                });
            }
            let first = self.byte()?;
            match first {
                NOTHING => continue,
                0x30 | READ_ERROR => {
                    self.varuint()?;
                    self.varuint()?;
                    continue;
                }
                0x00..=0x2F => {}
                _ => return None,
            }
            let kind = Kind::of(first >> 2);
            let count = match first & 3 {
                0 => self.varuint()?,
                count => u16::from(count),
            };
            let register = self.varuint()?;
            match (first & 0xF0, count) {
                (_, 0) => {}
                (READ, count) => return Some(Said::Read { register, kind, count }),
                (operation, count) => {
                    self.values = Some((operation == REPLY, kind, register, count));
                }
            }
        }
    }
}

/// The data of a frame in the making.
#[derive(Clone, Debug, Default)]
pub struct Payload {
    bytes: Vec<u8>,
}

impl Payload {
    fn head(&mut self, operation: u8, kind: Kind, register: u16, count: usize) {
        let code = operation | (kind as u8) << 2;
        match count {
            1..=3 => self.bytes.push(code | count as u8),
            _ => {
                self.bytes.push(code);
                self.varuint(count as u16);
            }
        }
        self.varuint(register);
    }

    fn varuint(&mut self, mut value: u16) {
        while value >= 0x80 {
            self.bytes.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.bytes.push(value as u8);
    }

    fn values(mut self, operation: u8, kind: Kind, register: u16, values: &[f64]) -> Self {
        self.head(operation, kind, register, values.len());
        for (at, value) in values.iter().enumerate() {
            kind.encode(register + at as u16, *value, &mut self.bytes);
        }
        self
    }

    /// Registers in a row get these values.
    pub fn write(self, kind: Kind, register: u16, values: &[f64]) -> Self {
        self.values(WRITE, kind, register, values)
    }

    /// The values of registers in a row, as they were asked for.
    pub fn reply(self, kind: Kind, register: u16, values: &[f64]) -> Self {
        self.values(REPLY, kind, register, values)
    }

    /// Asks for registers in a row.
    pub fn read(mut self, kind: Kind, register: u16, count: usize) -> Self {
        self.head(READ, kind, register, count);
        self
    }

    /// A register that is not there was asked for.
    pub fn read_error(mut self, register: u16) -> Self {
        self.bytes.push(READ_ERROR);
        self.varuint(register);
        self.varuint(1);
        self
    }

    /// Whether anything was said.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// A CAN FD frame, filled up to a length that there is.
    pub fn frame(self, id: u32) -> CanFrame {
        CanFrame::flexible(id, &self.bytes, NOTHING)
    }
}

#[cfg(test)]
mod tests {
    use super::super::registers::{GOAL_POSITION, MODE, POSITION, VOLTAGE};
    use super::*;

    #[test]
    fn subframes_have_their_published_bytes() {
        let payload = Payload::default()
            .write(Kind::I8, MODE, &[10.0])
            .write(Kind::F32, GOAL_POSITION, &[0.25, 0.0])
            .read(Kind::I8, MODE, 1)
            .read(Kind::F32, POSITION, 3)
            .read(Kind::I16, 0x100, 5);
        let wanted = [
            0x01, 0x00, 0x0A, 0x0E, 0x20, 0, 0, 0x80, 0x3E, 0, 0, 0, 0, 0x11, 0x00, 0x1F, 0x01,
            0x14, 0x05, 0x80, 0x02,
        ];
        assert_eq!(payload.bytes, wanted);
        let said: Vec<Said> = Saying::of(&wanted).collect();
        assert_eq!(said[0], Said::Write { register: MODE, value: 10.0 });
        assert_eq!(said[1], Said::Write { register: GOAL_POSITION, value: 0.25 });
        assert_eq!(said[4], Said::Read { register: POSITION, kind: Kind::F32, count: 3 });
        assert_eq!(said[5], Said::Read { register: 0x100, kind: Kind::I16, count: 5 });
        let frame = payload.frame(0x8001);
        assert_eq!((frame.data().len(), frame.data()[21..].to_vec()), (24, vec![NOTHING; 3]));
    }

    #[test]
    fn integers_count_units_and_their_least_is_no_number() {
        for kind in [Kind::I8, Kind::I16, Kind::I32, Kind::F32] {
            let reply = Payload::default().reply(kind, VOLTAGE, &[24.0, f64::NAN]);
            let said: Vec<Said> = Saying::of(&reply.bytes).collect();
            assert_eq!(said[0], Said::Reply { register: VOLTAGE, value: 24.0 });
            assert!(matches!(said[1], Said::Reply { value, .. } if value.is_nan()));
        }
    }

    #[test]
    fn what_is_cut_off_or_no_protocol_ends_the_frame() {
        assert_eq!(Saying::of(&[0x50, 0x50]).count(), 0);
        assert_eq!(Saying::of(&[0x2F, 0x01, 0, 0]).count(), 0);
        assert_eq!(Saying::of(&[0x31, 0x7F, 1, 0x21, 0x00, 10]).count(), 1);
        assert_eq!(Saying::of(&[0x60, 0x21, 0x00, 10]).count(), 0);
        assert_eq!(Saying::of(&[0x14, 0xFF, 0xFF, 0xFF, 0xFF]).count(), 0);
    }
}
