//! A writer and a reader for the part of ROS 2's CDR encoding that recordings
//! and topics need.
//!
//! Little-endian plain CDR version 1: a four-byte header, then every number
//! aligned to its own size, counted from the end of the header.

/// Writes one CDR message.
#[derive(Debug)]
pub struct CdrWriter {
    bytes: Vec<u8>,
}

impl CdrWriter {
    const HEADER: [u8; 4] = [0, 1, 0, 0];

    /// An empty message with its header.
    #[allow(clippy::new_without_default)] // one name for one thing
    pub fn new() -> Self {
        Self { bytes: Self::HEADER.to_vec() }
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

    /// Appends a 64-bit float.
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

    /// Appends a sequence of 32-bit floats.
    pub fn f32s(&mut self, values: impl ExactSizeIterator<Item = f32>) -> &mut Self {
        self.u32(values.len() as u32);
        for value in values {
            self.u32(value.to_bits());
        }
        self
    }

    /// Appends a sequence of bytes.
    pub fn bytes(&mut self, values: &[u8]) -> &mut Self {
        self.u32(values.len() as u32);
        self.bytes.extend_from_slice(values);
        self
    }

    /// Appends a `builtin_interfaces/Time` in seconds.
    pub fn time(&mut self, time_s: f64) -> &mut Self {
        let nanoseconds = (time_s * 1e9).round() as i64;
        self.u32(nanoseconds.div_euclid(1_000_000_000) as i32 as u32)
            .u32(nanoseconds.rem_euclid(1_000_000_000) as u32)
    }

    /// `std_msgs/Header`: time stamp in seconds and frame.
    pub fn header(&mut self, time_s: f64, frame: &str) -> &mut Self {
        self.time(time_s).string(frame)
    }

    /// Takes the finished message out.
    pub fn finish(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.bytes)
    }
}

/// Reads one CDR message without panic or an allocation larger than the message.
#[derive(Clone, Copy, Debug)]
pub struct CdrReader<'a> {
    body: &'a [u8],
    at: usize,
}

impl<'a> CdrReader<'a> {
    /// A reader of this message; `None` if it is not little-endian plain CDR.
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

    /// Reads a 64-bit float.
    pub fn f64(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    /// Reads a string, without its closing zero.
    pub fn string(&mut self) -> Option<&'a str> {
        let length = self.u32()? as usize;
        let end = self.at.checked_add(length)?;
        let bytes = self.body.get(self.at..end)?;
        self.at = end;
        std::str::from_utf8(bytes.strip_suffix(&[0])?).ok()
    }

    /// Reads a sequence of bytes.
    pub fn bytes(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()? as usize;
        let end = self.at.checked_add(length)?;
        let bytes = self.body.get(self.at..end)?;
        self.at = end;
        Some(bytes)
    }

    /// Reads a sequence of 64-bit floats.
    pub fn f64s(&mut self) -> Option<Vec<f64>> {
        self.sequence(8, Self::f64)
    }

    /// Reads a sequence of 32-bit floats.
    pub fn f32s(&mut self) -> Option<Vec<f32>> {
        self.sequence(4, |reader| reader.u32().map(f32::from_bits))
    }

    /// A sequence of items of so many bytes each.
    fn sequence<T>(
        &mut self,
        bytes: usize,
        item: impl Fn(&mut Self) -> Option<T>,
    ) -> Option<Vec<T>> {
        let length = self.u32()? as usize;
        let fits = length <= self.body.len() / bytes;
        fits.then(|| (0..length).map(|_| item(self)).collect())?
    }

    /// Skips the time stamp `builtin_interfaces/Time`.
    pub fn time(&mut self) -> Option<()> {
        self.u32()?;
        self.u32().map(drop)
    }

    /// Reads a `std_msgs/Header` and returns its frame.
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
