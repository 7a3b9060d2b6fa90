//! Raw samples without a header, as capture programs write them.

use std::fmt;
use std::io::{ErrorKind, Read};
use std::str::FromStr;

use super::error::{SourceError, SourceFault};

/// Bytes read at once: few, so that live sound arrives soon.
const READ_BYTES: usize = 4096;

/// Encoding of one sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PcmEncoding {
    /// Unsigned bytes, 128 is silence.
    U8,
    /// Signed 16 bits, low byte first.
    S16Le,
    /// Signed 24 bits in three bytes, low byte first.
    S24Le,
    /// Signed 32 bits, low byte first.
    S32Le,
    /// IEEE float of 32 bits, low byte first, -1 to 1.
    F32Le,
}

impl PcmEncoding {
    /// All encodings with their names, as ffmpeg and ALSA's tools spell them in
    /// lower case, and the bytes of a sample.
    pub(super) const TABLE: [(Self, &'static str, usize); 5] = [
        (Self::U8, "u8", 1),
        (Self::S16Le, "s16le", 2),
        (Self::S24Le, "s24le", 3),
        (Self::S32Le, "s32le", 4),
        (Self::F32Le, "f32le", 4),
    ];

    const fn bytes(self) -> usize {
        Self::TABLE[self as usize].2
    }

    /// One sample from exactly [`Self::bytes`] bytes.
    fn decode(self, bytes: &[u8]) -> f32 {
        // Left-aligned in 32 bits, so that one division serves all.
        let mut word = [0u8; 4];
        word[4 - bytes.len()..].copy_from_slice(bytes);
        match self {
            Self::U8 => (f32::from(word[3]) - 128.0) / 128.0,
            Self::F32Le => f32::from_le_bytes(word),
            Self::S16Le | Self::S24Le | Self::S32Le => {
                (f64::from(i32::from_le_bytes(word)) / 2_147_483_648.0) as f32
            }
        }
    }
}

impl fmt::Display for PcmEncoding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::TABLE[*self as usize].1)
    }
}

/// No encoding has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown sample format {0:?}; known are u8, s16le, s24le, s32le, f32le")]
pub struct UnknownEncoding(String);

impl FromStr for PcmEncoding {
    type Err = UnknownEncoding;

    fn from_str(name: &str) -> Result<Self, UnknownEncoding> {
        let known = Self::TABLE.into_iter().find(|row| row.1 == name);
        known.map_or_else(|| Err(UnknownEncoding(name.to_owned())), |row| Ok(row.0))
    }
}

/// Format of raw samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PcmFormat {
    /// Encoding of one sample.
    pub encoding: PcmEncoding,
    /// Sample rate, frames a second.
    pub sample_rate_hz: u32,
    /// Samples in a frame, which are averaged to mono.
    pub channels: u16,
}

impl PcmFormat {
    /// Bytes of a frame.
    pub fn frame_bytes(&self) -> usize {
        self.encoding.bytes() * usize::from(self.channels)
    }
}

pub(crate) struct PcmReader {
    name: String,
    reader: Box<dyn Read + Send>,
    format: PcmFormat,
    /// Bytes of a frame that is not complete yet.
    pending: Vec<u8>,
}

impl PcmReader {
    pub(crate) fn new(
        name: &str,
        reader: Box<dyn Read + Send>,
        format: PcmFormat,
    ) -> Result<Self, SourceError> {
        let rate_ok = (4_000..=384_000).contains(&format.sample_rate_hz);
        if !rate_ok || !(1..=64).contains(&format.channels) {
            let PcmFormat { channels, sample_rate_hz, .. } = format;
            let fault = SourceFault::Format { channels, sample_rate_hz };
            return Err(fault.of(name));
        }
        Ok(Self {
            name: name.to_owned(),
            reader,
            format,
            pending: Vec::with_capacity(2 * READ_BYTES),
        })
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn format(&self) -> PcmFormat {
        self.format
    }

    /// Appends at least one sample, or returns `false` at the end.
    pub(crate) fn next_block(&mut self, block: &mut Vec<f32>) -> Result<bool, SourceError> {
        let sample_bytes = self.format.encoding.bytes();
        let frame_bytes = self.format.frame_bytes();
        while self.pending.len() < frame_bytes {
            if !self.read()? {
                return Ok(false);
            }
        }
        let whole = self.pending.len() / frame_bytes * frame_bytes;
        let share = 1.0 / f32::from(self.format.channels);
        block.extend(self.pending[..whole].chunks_exact(frame_bytes).map(|frame| {
            let samples = frame.chunks_exact(sample_bytes);
            let sum: f32 = samples.map(|b| self.format.encoding.decode(b)).sum();
            sum * share
        }));
        self.pending.drain(..whole);
        Ok(true)
    }

    fn read(&mut self) -> Result<bool, SourceError> {
        let mut bytes = [0u8; READ_BYTES];
        loop {
            match self.reader.read(&mut bytes) {
                Ok(0) => return Ok(false),
                Ok(count) => {
                    self.pending.extend_from_slice(&bytes[..count]);
                    return Ok(true);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(SourceFault::io(error).of(&self.name)),
            }
        }
    }
}
