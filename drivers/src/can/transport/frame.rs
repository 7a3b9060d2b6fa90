//! One classic CAN frame and its time on the wire.

use std::fmt;

/// A classic CAN data or remote frame, at most eight bytes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct CanFrame {
    id: u32,
    extended: bool,
    remote: bool,
    length: u8,
    data: [u8; 8],
}

impl CanFrame {
    pub(crate) const STANDARD_MAX: u32 = 0x7FF;
    pub(crate) const EXTENDED_MAX: u32 = 0x1FFF_FFFF;

    /// A frame with an 11-bit id. Higher bits of the id and bytes past the eighth are cut off.
    pub fn standard(id: u32, data: &[u8]) -> Self {
        Self::with(id & Self::STANDARD_MAX, false, data)
    }

    /// A frame with a 29-bit id, cut off likewise.
    pub fn extended(id: u32, data: &[u8]) -> Self {
        Self::with(id & Self::EXTENDED_MAX, true, data)
    }

    fn with(id: u32, extended: bool, data: &[u8]) -> Self {
        let length = data.len().min(8);
        let mut bytes = [0; 8];
        bytes[..length].copy_from_slice(&data[..length]);
        Self { id, extended, remote: false, length: length as u8, data: bytes }
    }

    /// A request for the frame with this 11-bit id, of `length` bytes.
    pub fn remote(id: u32, length: u8) -> Self {
        Self::standard(id, &[]).into_remote(length)
    }

    /// The same id as a remote frame that asks for `length` bytes.
    pub fn into_remote(self, length: u8) -> Self {
        Self { remote: true, length: length.min(8), data: [0; 8], ..self }
    }

    /// The frame that a link received, with `remote_length` for a remote frame;
    /// `None` if the id or the number of bytes is out of range.
    pub(crate) fn from_parts(
        id: u32,
        extended: bool,
        remote_length: Option<u8>,
        data: &[u8],
    ) -> Option<Self> {
        let highest = match extended {
            true => Self::EXTENDED_MAX,
            false => Self::STANDARD_MAX,
        };
        if id > highest || data.len() > 8 || remote_length.is_some_and(|length| length > 8) {
            return None;
        }
        let frame = Self::with(id, extended, data);
        Some(remote_length.map_or(frame, |length| frame.into_remote(length)))
    }

    /// The id, 11 or 29 bits.
    pub fn id(&self) -> u32 {
        self.id
    }

    /// Whether the id has 29 bits instead of 11.
    pub fn is_extended(&self) -> bool {
        self.extended
    }

    /// Whether this asks for data instead of carrying it.
    pub fn is_remote(&self) -> bool {
        self.remote
    }

    /// Data length code: bytes carried, or asked for.
    pub fn length(&self) -> u8 {
        self.length
    }

    /// The bytes; none in a remote frame.
    pub fn data(&self) -> &[u8] {
        if self.remote {
            return &[];
        }
        &self.data[..usize::from(self.length)]
    }

    /// The bytes, if there are eight of them.
    pub fn eight(&self) -> Option<[u8; 8]> {
        (!self.remote && self.length == 8).then_some(self.data)
    }

    /// Bits on the wire with the pause between frames, no stuff bits.
    pub fn nominal_bits(&self) -> u32 {
        nominal_bits(self.extended, self.data().len())
    }
}

/// Four bytes of eight.
pub(crate) fn word(data: &[u8; 8], at: usize) -> [u8; 4] {
    [data[at], data[at + 1], data[at + 2], data[at + 3]]
}

/// Bits of a frame of `bytes` bytes with the pause between frames, no stuff bits.
pub(crate) fn nominal_bits(extended: bool, bytes: usize) -> u32 {
    let overhead = if extended { 67 } else { 47 };
    overhead + 8 * bytes as u32
}

/// The same with the most stuff bits there can be: after the first five bits,
/// one in every four up to the end of the checksum.
pub(crate) fn worst_bits(extended: bool, bytes: usize) -> u32 {
    let overhead = if extended { 54 } else { 34 };
    let stuffable = overhead + 8 * bytes as u32;
    nominal_bits(extended, bytes) + (stuffable - 1) / 4
}

impl fmt::Debug for CanFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.extended {
            true => write!(f, "{:08X}", self.id)?,
            false => write!(f, "{:03X}", self.id)?,
        }
        if self.remote {
            return write!(f, "#R{}", self.length);
        }
        write!(f, "#")?;
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_bytes_take_the_published_bits() {
        assert_eq!((nominal_bits(false, 8), worst_bits(false, 8)), (111, 135));
        assert_eq!((nominal_bits(true, 8), worst_bits(true, 8)), (131, 160));
        assert_eq!(CanFrame::remote(5, 8).nominal_bits(), 47);
    }

    #[test]
    fn what_does_not_fit_is_cut_off() {
        let frame = CanFrame::standard(0xFFFF, &[7; 12]);
        assert_eq!((frame.id(), frame.length()), (0x7FF, 8));
        assert_eq!(format!("{frame:?}"), "7FF#0707070707070707");
        assert_eq!(format!("{:?}", CanFrame::remote(0x21, 8)), "021#R8");
    }
}
