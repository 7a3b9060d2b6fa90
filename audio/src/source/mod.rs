//! Where sound comes from: a recording, raw samples from any reader, or live.
//!
//! An [`AudioSource`] gives mono blocks at its own rate, in order, without ever
//! holding the whole recording. It blocks while it reads, so it belongs on a
//! thread of its own when the robot is live. A live source keeps to the clock:
//! where no sound comes it gives silence (see [`capture`](crate::capture)).
//!
//! Refused, each with its own error that names the source: no such file,
//! nothing in it, no audio in it, nothing decodable, silence, less than
//! [`SHORTEST_S`]. A broken packet between good ones is skipped and counted.

mod error;
mod file;
pub(crate) mod pcm;

use std::io::Read;
use std::path::Path;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

pub use error::SourceError;
pub use pcm::{PcmEncoding, PcmFormat, UnknownEncoding};

use crate::capture::{CaptureStats, LIVE_RATE_HZ, Listener, Notice, listen_to_pipe};
use file::FileReader;
use pcm::PcmReader;

/// How often a live source looks for sound while it waits for some.
const LIVE_POLL: Duration = Duration::from_millis(1);

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
    Live(Box<Live>),
}

/// Sound as it happens.
struct Live {
    listener: Listener,
    /// Why a pipe ended before its end.
    failures: Option<Receiver<SourceError>>,
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

    /// Raw samples as another program writes them, in real time: a thread reads
    /// ahead, the stream keeps to the clock, and silence takes the place of
    /// what does not come.
    pub fn live_reader(
        name: &str,
        reader: impl Read + Send + 'static,
        format: PcmFormat,
    ) -> Result<Self, SourceError> {
        let reader = PcmReader::new(name, Box::new(reader), format)?;
        let (listener, failures) = listen_to_pipe(reader)?;
        Ok(Self::live(name, listener, Some(failures)))
    }

    /// An input of the system by id or name, the default one if `None`.
    ///
    /// # Errors
    /// There is none of that name (the error lists those there are), or it
    /// cannot be opened.
    #[cfg(feature = "mic")]
    pub fn microphone(name: Option<&str>) -> Result<Self, SourceError> {
        let listener = crate::capture::listen_to_microphone(name)?;
        Ok(Self::live(name.unwrap_or("default"), listener, None))
    }

    fn live(name: &str, listener: Listener, failures: Option<Receiver<SourceError>>) -> Self {
        Self {
            name: name.to_owned(),
            sample_rate_hz: LIVE_RATE_HZ,
            duration_s: None,
            samples: 0,
            reader: Reader::Live(Box::new(Live { listener, failures })),
        }
    }

    /// When the sound at this position was captured; `None` if not live.
    pub fn captured_at(&self, position_s: f64) -> Option<Instant> {
        match &self.reader {
            Reader::Live(live) => live.listener.captured_at(position_s),
            _ => None,
        }
    }

    /// The next thing about live sound that the user should know.
    pub fn next_notice(&mut self) -> Option<Notice> {
        match &mut self.reader {
            Reader::Live(live) => live.listener.next_notice(),
            _ => None,
        }
    }

    /// Totals of a live source.
    pub fn capture_stats(&self) -> Option<CaptureStats> {
        match &self.reader {
            Reader::Live(live) => Some(live.listener.stats()),
            _ => None,
        }
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
            Reader::Pcm(_) | Reader::Live(_) => 0,
        }
    }

    /// Puts the next samples, -1 to 1, into `block` in place of what it held.
    /// `false` at the end of the source, with an empty block.
    pub fn next_block(&mut self, block: &mut Vec<f32>) -> Result<bool, SourceError> {
        block.clear();
        let more = match &mut self.reader {
            Reader::File(reader) => reader.next_block(block)?,
            Reader::Pcm(reader) => reader.next_block(block)?,
            Reader::Live(live) => live.next_block(block)?,
        };
        self.samples += block.len() as u64;
        if !more && self.position_s() < SHORTEST_S {
            return Err(SourceError::short(&self.name, self.position_s()));
        }
        Ok(more)
    }
}

impl Live {
    /// Waits until there is something to hear, or silence in its place.
    fn next_block(&mut self, block: &mut Vec<f32>) -> Result<bool, SourceError> {
        while self.listener.take(Instant::now(), block) && block.is_empty() {
            std::thread::sleep(LIVE_POLL);
        }
        if !block.is_empty() {
            return Ok(true); // a failure is told when all before it was heard
        }
        match self.failures.as_ref().and_then(|f| f.try_recv().ok()) {
            Some(error) => Err(error),
            None => Ok(false),
        }
    }
}

#[cfg(test)]
mod tests;
