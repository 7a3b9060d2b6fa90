//! Where sound comes from: a recording, or raw samples from any reader.
//!
//! An [`AudioSource`] gives mono blocks at its own rate, in order, without ever
//! holding the whole recording. It blocks while it reads, so it belongs on a
//! thread of its own when the robot is live.
//!
//! Refused, each with its own error that names the source: no such file,
//! nothing in it, no audio in it, nothing decodable, silence, less than
//! [`SHORTEST_S`]. A broken packet between good ones is skipped and counted.

mod error;
mod file;
mod pcm;

use std::io::Read;
use std::path::Path;

pub use error::SourceError;
pub use pcm::{PcmEncoding, PcmFormat, UnknownEncoding};

use file::FileReader;
use pcm::PcmReader;

/// The least that can be danced to, seconds.
pub const SHORTEST_S: f64 = 0.5;
/// A recording that never rises above this (-80 dB of full scale) is silent.
const AUDIBLE: f32 = 1e-4;

/// A stream of mono samples.
pub struct AudioSource {
    name: String,
    sample_rate_hz: u32,
    duration_s: Option<f64>,
    samples: u64,
    reader: Reader,
}

enum Reader {
    File(FileReader),
    Pcm(PcmReader),
}

impl AudioSource {
    /// Opens a recording: wav, flac, mp3, ogg/vorbis (by content, not by
    /// name), any rate, channels averaged. Reads ahead until it has proved
    /// long enough and not silent, then starts again from the beginning.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, SourceError> {
        let path = path.as_ref();
        file::check(path)?;
        let reader = FileReader::open(path)?;
        Ok(Self {
            name: path.display().to_string(),
            sample_rate_hz: reader.sample_rate_hz(),
            duration_s: reader.duration_s(),
            samples: 0,
            reader: Reader::File(reader),
        })
    }

    /// Raw samples from any reader, for instance standard input; `name` is
    /// what errors call it. Blocks are as small as the reader delivers them.
    pub fn from_reader(
        name: &str,
        reader: impl Read + Send + 'static,
        format: PcmFormat,
    ) -> Result<Self, SourceError> {
        Ok(Self {
            name: name.to_owned(),
            sample_rate_hz: format.sample_rate_hz,
            duration_s: None,
            samples: 0,
            reader: Reader::Pcm(PcmReader::new(name, Box::new(reader), format)?),
        })
    }

    /// What errors call the source: the path or the name given.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Samples a second.
    pub fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    /// Length in seconds, if the file says it.
    pub fn duration_s(&self) -> Option<f64> {
        self.duration_s
    }

    /// Seconds delivered so far.
    pub fn position_s(&self) -> f64 {
        self.samples as f64 / f64::from(self.sample_rate_hz)
    }

    /// Broken packets that were left out so far.
    pub fn skipped_packets(&self) -> u64 {
        match &self.reader {
            Reader::File(reader) => reader.skipped_packets(),
            Reader::Pcm(_) => 0,
        }
    }

    /// Puts the next samples, -1 to 1, into `block` in place of what it held.
    /// `false` at the end of the source, with an empty block.
    pub fn next_block(&mut self, block: &mut Vec<f32>) -> Result<bool, SourceError> {
        block.clear();
        let more = match &mut self.reader {
            Reader::File(reader) => reader.next_block(block)?,
            Reader::Pcm(reader) => reader.next_block(block)?,
        };
        self.samples += block.len() as u64;
        if !more && self.position_s() < SHORTEST_S {
            return Err(SourceError::short(&self.name, self.position_s()));
        }
        Ok(more)
    }
}

#[cfg(test)]
mod tests;
