//! A writer and a reader for the part of ROS 2's CDR encoding that recordings
//! and topics need.
//!
//! Little-endian plain CDR version 1: a four-byte header, then every number
//! aligned to its own size, counted from the end of the header.

/// Builds one CDR message.
#[derive(Debug)]
pub struct CdrWriter {
    bytes: Vec<u8>,
}

impl Default for CdrWriter {
    fn default() -> Self {
        Self::new()
    }
}

impl CdrWriter {
    const HEADER: [u8; 4] = [0, 1, 0, 0];

    /// An empty message with its header.
    pub fn new() -> Self {
        Self {
            bytes: Self::HEADER.to_vec(),
        }
    }

    fn align(&mut self, size: usize) {
        let past = (self.bytes.len() - Self::HEADER.len()) % size;
        if past > 0 {
            self.bytes.resize(self.bytes.len() + size - past, 0);
        }
    }

    /// A 32-bit unsigned number; also the length of a sequence.
    pub fn u32(&mut self, value: u32) -> &mut Self {
        self.align(4);
        self.bytes.extend(value.to_le_bytes());
        self
    }

    /// An 8-bit unsigned number.
    pub fn u8(&mut self, value: u8) -> &mut Self {
        self.bytes.push(value);
        self
    }

    /// A 32-bit signed number.
    pub fn i32(&mut self, value: i32) -> &mut Self {
        self.u32(value as u32)
    }

    /// A 64-bit float.
    pub fn f64(&mut self, value: f64) -> &mut Self {
        self.align(8);
        self.bytes.extend(value.to_le_bytes());
        self
    }

    /// A string: length with the closing zero, bytes, zero.
    pub fn string(&mut self, value: &str) -> &mut Self {
        self.u32(value.len() as u32 + 1);
        self.bytes.extend(value.as_bytes());
        self.bytes.push(0);
        self
    }

    /// A sequence of floats.
    pub fn f64s(&mut self, values: impl ExactSizeIterator<Item = f64>) -> &mut Self {
        self.u32(values.len() as u32);
        for value in values {
            self.f64(value);
        }
        self
    }

    /// A sequence of short floats.
    pub fn f32s(&mut self, values: impl ExactSizeIterator<Item = f32>) -> &mut Self {
        self.u32(values.len() as u32);
        for value in values {
            self.u32(value.to_bits());
        }
        self
    }

    /// `builtin_interfaces/Time`.
    pub fn time(&mut self, time_s: f64) -> &mut Self {
        let nanoseconds = (time_s * 1e9).round() as i64;
        self.i32(nanoseconds.div_euclid(1_000_000_000) as i32)
            .u32(nanoseconds.rem_euclid(1_000_000_000) as u32)
    }

    /// `std_msgs/Header`: time stamp in seconds and frame.
    pub fn header(&mut self, time_s: f64, frame: &str) -> &mut Self {
        self.time(time_s).string(frame)
    }

    /// The finished message.
    pub fn finish(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.bytes)
    }
}

/// Takes one CDR message apart. Nothing that comes in can make it panic, or
/// take memory that the message does not have.
#[derive(Clone, Copy, Debug)]
pub struct CdrReader<'a> {
    body: &'a [u8],
    at: usize,
}

impl<'a> CdrReader<'a> {
    /// A message; `None` if it is no little-endian plain CDR.
    pub fn new(message: &'a [u8]) -> Option<Self> {
        let body = message.strip_prefix(&CdrWriter::HEADER)?;
        Some(Self { body, at: 0 })
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let from = self.at.next_multiple_of(N);
        self.at = from.checked_add(N)?;
        self.body.get(from..self.at)?.try_into().ok()
    }

    /// An 8-bit unsigned number.
    pub fn u8(&mut self) -> Option<u8> {
        self.take().map(u8::from_le_bytes)
    }

    /// A 32-bit unsigned number; also the length of a sequence.
    pub fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    /// A 64-bit float.
    pub fn f64(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    /// A string.
    pub fn string(&mut self) -> Option<&'a str> {
        let length = self.u32()? as usize;
        let end = self.at.checked_add(length)?;
        let bytes = self.body.get(self.at..end)?;
        self.at = end;
        std::str::from_utf8(bytes.strip_suffix(&[0])?).ok()
    }

    /// A sequence of floats.
    pub fn f64s(&mut self) -> Option<Vec<f64>> {
        let length = self.u32()? as usize;
        let fits = length <= self.body.len() / 8;
        fits.then(|| (0..length).map(|_| self.f64()).collect())?
    }

    /// A sequence of short floats.
    pub fn f32s(&mut self) -> Option<Vec<f32>> {
        let length = self.u32()? as usize;
        let fits = length <= self.body.len() / 4;
        fits.then(|| {
            (0..length)
                .map(|_| self.u32().map(f32::from_bits))
                .collect()
        })?
    }

    /// `builtin_interfaces/Time`, left out.
    pub fn time(&mut self) -> Option<()> {
        self.u32()?;
        self.u32().map(drop)
    }

    /// `std_msgs/Header`; its frame.
    pub fn header(&mut self) -> Option<&'a str> {
        self.time()?;
        self.string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read_and_what_is_cut_off_is_not() {
        let values = [1.5, -2.0];
        let mut writer = CdrWriter::new();
        writer.header(1.0, "base").u8(3).string("knee").u32(7);
        writer.f32s([0.25].into_iter());
        let bytes = writer.f64s(values.into_iter()).finish();
        let read = |bytes: &[u8]| -> Option<(String, u32, Vec<f64>)> {
            let mut reader = CdrReader::new(bytes)?;
            assert_eq!(reader.header()?, "base");
            assert_eq!(reader.u8()?, 3);
            let (name, number) = (reader.string()?.to_owned(), reader.u32()?);
            assert_eq!(reader.f32s()?, [0.25]);
            Some((name, number, reader.f64s()?))
        };
        assert_eq!(read(&bytes), Some(("knee".into(), 7, values.to_vec())));
        assert!((0..bytes.len()).all(|end| read(&bytes[..end]).is_none()));
    }

    #[test]
    fn numbers_are_aligned_after_the_header() {
        let bytes = CdrWriter::new().string("ab").f64(1.0).finish();
        assert_eq!(bytes[..4], [0, 1, 0, 0]);
        assert_eq!(bytes[4..11], [3, 0, 0, 0, b'a', b'b', 0]);
        assert_eq!(bytes[11], 0, "one byte of padding up to 8");
        assert_eq!(bytes[12..20], 1.0f64.to_le_bytes());
    }
}
