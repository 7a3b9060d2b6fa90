//! A writer for the part of ROS 2's CDR encoding that recordings need.
//!
//! Little-endian plain CDR version 1: a four-byte header, then every number
//! aligned to its own size, counted from the end of the header.

/// Builds one CDR message.
#[derive(Debug)]
pub struct CdrWriter {
    bytes: Vec<u8>,
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

    /// `std_msgs/Header`: time stamp in seconds and frame.
    pub fn header(&mut self, time_s: f64, frame: &str) -> &mut Self {
        let nanoseconds = (time_s * 1e9).round() as i64;
        self.i32(nanoseconds.div_euclid(1_000_000_000) as i32)
            .u32(nanoseconds.rem_euclid(1_000_000_000) as u32)
            .string(frame)
    }

    /// The finished message.
    pub fn finish(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_after_the_header() {
        let bytes = CdrWriter::new().string("ab").f64(1.0).finish();
        assert_eq!(bytes[..4], [0, 1, 0, 0]);
        assert_eq!(bytes[4..11], [3, 0, 0, 0, b'a', b'b', 0]);
        assert_eq!(bytes[11], 0, "one byte of padding up to 8");
        assert_eq!(bytes[12..20], 1.0f64.to_le_bytes());
    }
}
