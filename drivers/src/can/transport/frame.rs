//! One CAN frame, classic or FD, and its time on the wire.

use std::fmt;

/// A classic CAN data or remote frame of at most eight bytes, or a CAN FD frame of at most 64.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct CanFrame {
    id: u32,
    extended: bool,
    remote: bool,
    flexible: bool,
    length: u8,
    data: [u8; 64],
}

/// The lengths beyond eight that CAN FD knows.
const LENGTHS: [u8; 7] = [12, 16, 20, 24, 32, 48, 64];
/// Data of CAN FD frames passes so many times faster than the rest.
const FASTER: u32 = 5;

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
        let mut bytes = [0; 64];
        bytes[..length].copy_from_slice(&data[..length]);
        Self { id, extended, remote: false, flexible: false, length: length as u8, data: bytes }
    }

    /// A CAN FD frame, its id of 29 bits if it has more than 11. `data` is filled up with
    /// `filler` to a length that there is; bytes past the 64th are cut off.
    pub fn flexible(id: u32, data: &[u8], filler: u8) -> Self {
        let id = id & Self::EXTENDED_MAX;
        let bytes = data.len().min(64);
        let fits = |length: &&u8| usize::from(**length) >= bytes;
        let length =
            if bytes <= 8 { bytes as u8 } else { *LENGTHS.iter().find(fits).unwrap_or(&64) };
        let mut filled = [0; 64];
        filled[..usize::from(length)].fill(filler);
        filled[..bytes].copy_from_slice(&data[..bytes]);
        let extended = id > Self::STANDARD_MAX;
        Self { id, extended, remote: false, flexible: true, length, data: filled }
    }

    /// A CAN FD frame that a link received; `None` if its length is none of CAN FD.
    pub(crate) fn flexible_from_parts(id: u32, data: &[u8]) -> Option<Self> {
        let length = u8::try_from(data.len()).ok()?;
        let is_one = (length <= 8 || LENGTHS.contains(&length)) && id <= Self::EXTENDED_MAX;
        is_one.then(|| Self::flexible(id, data, 0))
    }

    /// A request for the frame with this 11-bit id, of `length` bytes.
    pub fn remote(id: u32, length: u8) -> Self {
        Self::standard(id, &[]).into_remote(length)
    }

    /// The same id as a remote frame that asks for `length` bytes.
    pub fn into_remote(self, length: u8) -> Self {
        Self { remote: true, length: length.min(8), data: [0; 64], ..self }
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

    /// Whether it is a CAN FD frame.
    pub fn is_flexible(&self) -> bool {
        self.flexible
    }

    /// Bytes carried, or asked for.
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

    /// The bytes of a classic frame, if there are eight of them.
    pub fn eight(&self) -> Option<[u8; 8]> {
        let data: Option<[u8; 8]> = self.data().try_into().ok();
        data.filter(|_| !self.flexible)
    }

    /// Bits on the wire with the pause between frames, no stuff bits; of a CAN FD frame in
    /// bits of the lower rate.
    pub fn nominal_bits(&self) -> u32 {
        match self.flexible {
            true => flexible_bits(self.extended, self.data().len()),
            false => nominal_bits(self.extended, self.data().len()),
        }
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

/// The same of a CAN FD frame: id and end at the lower rate, data and checksum
/// at the higher one.
pub(crate) fn flexible_bits(extended: bool, bytes: usize) -> u32 {
    let slow = if extended { 35 + 12 } else { 17 + 12 };
    let checksum = if bytes <= 16 { 17 + 9 } else { 21 + 10 };
    slow + (5 + 8 * bytes as u32 + checksum).div_ceil(FASTER)
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
        write!(f, "{}", if self.flexible { "##" } else { "#" })?;
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
    fn frames_of_can_fd_are_filled_up_to_a_length_that_there_is() {
        let frame = CanFrame::flexible(0x8001, &[7; 42], 0x50);
        assert_eq!((frame.length(), frame.is_extended(), frame.eight()), (48, true, None));
        assert_eq!(frame.data()[41..43], [7, 0x50]);
        assert_eq!(CanFrame::flexible(1, &[7; 8], 0).length(), 8);
        assert_eq!(CanFrame::flexible(1, &[7; 99], 0).length(), 64);
        assert_eq!(CanFrame::flexible_from_parts(1, &[0; 9]), None);
        // 48 bytes at 5 Mbit/s take less than eight classic ones.
        assert!((100..140).contains(&frame.nominal_bits()), "{}", frame.nominal_bits());
    }

    #[test]
    fn what_does_not_fit_is_cut_off() {
        let frame = CanFrame::standard(0xFFFF, &[7; 12]);
        assert_eq!((frame.id(), frame.length()), (0x7FF, 8));
        assert_eq!(format!("{frame:?}"), "7FF#0707070707070707");
        assert_eq!(format!("{:?}", CanFrame::remote(0x21, 8)), "021#R8");
    }
}
