//! Sources of sound: a recording, raw samples from any reader, or live sound.
//!
//! An [`AudioSource`] gives mono blocks at its own rate, in order, without ever
//! holding the whole recording. Reading blocks, so a source belongs on a thread
//! of its own when the robot is live. A live source keeps to the clock: silence
//! takes the place of sound that does not arrive (see [`capture`](crate::capture)).
//!
//! Refused, each with its own error that names the source: no such file,
//! nothing in it, no audio in it, nothing decodable, silence, less than
//! [`SHORTEST_S`]. A broken packet between good ones is skipped and counted.

mod error;
mod file;
mod live_pcm;
mod pcm;

use std::io::Read;
use std::path::Path;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

pub use error::{SHORTEST_S, SourceError, SourceFault};
pub use pcm::{PcmEncoding, PcmFormat, UnknownEncoding};

use crate::capture::{CaptureEvent, CaptureStats, LIVE_RATE_HZ, LiveStream};
use file::FileReader;
use live_pcm::open_live_pcm;
use pcm::PcmReader;

/// Interval at which a live source polls for sound.
const LIVE_POLL: Duration = Duration::from_millis(1);
/// How long a live source waits for sound before it returns an empty block.
pub const LONGEST_WAIT: Duration = Duration::from_millis(50);

/// A stream of mono samples.
pub struct AudioSource {
    name: String,
    sample_rate_hz: u32,
    duration_s: Option<f64>,
    samples: u64,
    reader: SourceReader,
}

enum SourceReader {
    File(FileReader),
    Pcm(PcmReader),
    Live(Box<LiveReader>),
}

struct LiveReader {
    stream: LiveStream,
    /// The error that ended a PCM stream early.
    failures: Option<Receiver<SourceError>>,
}

impl AudioSource {
    /// Opens a recording: wav, flac, mp3, ogg/vorbis (by content, not by name),
    /// any rate, channels averaged. Reads ahead until the recording is known to be
    /// long enough and not silent, then starts again from the beginning.
    /// Errors: any [`SourceFault`] but a raw format.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, SourceError> {
        let path = path.as_ref();
        file::check(path)?;
        let reader = FileReader::open(path)?;
        let (name, rate_hz) = (path.display().to_string(), reader.sample_rate_hz());
        let duration_s = reader.duration_s();
        let source = Self::new(&name, rate_hz, SourceReader::File(reader));
        Ok(Self { duration_s, ..source })
    }

    /// Raw samples from any reader, for instance standard input; errors begin with
    /// `name`. Blocks are as small as the reader delivers them.
    /// Errors: a format with no channels or an impossible rate.
    pub fn from_reader(
        name: &str,
        reader: impl Read + Send + 'static,
        format: PcmFormat,
    ) -> Result<Self, SourceError> {
        let reader = PcmReader::new(name, Box::new(reader), format)?;
        Ok(Self::new(name, format.sample_rate_hz, SourceReader::Pcm(reader)))
    }

    /// Raw samples that another program writes in real time: a thread reads ahead,
    /// the stream keeps to the clock, and silence fills gaps.
    /// Errors: a format with no channels or an impossible rate; no thread to be had.
    pub fn live_reader(
        name: &str,
        reader: impl Read + Send + 'static,
        format: PcmFormat,
    ) -> Result<Self, SourceError> {
        let reader = PcmReader::new(name, Box::new(reader), format)?;
        let (stream, failures) = open_live_pcm(reader)?;
        Ok(Self::live(name, stream, Some(failures)))
    }

    /// An input of the system by id or name, the default one if `None`.
    /// Errors: no such input (the error lists the known ones), or one that fails to open.
    #[cfg(feature = "mic")]
    pub fn microphone(name: Option<&str>) -> Result<Self, crate::capture::DeviceError> {
        let stream = crate::capture::open_microphone(name)?;
        Ok(Self::live(name.unwrap_or("default"), stream, None))
    }

    fn live(name: &str, stream: LiveStream, failures: Option<Receiver<SourceError>>) -> Self {
        let reader = LiveReader { stream, failures };
        Self::new(name, LIVE_RATE_HZ, SourceReader::Live(Box::new(reader)))
    }

    fn new(name: &str, sample_rate_hz: u32, reader: SourceReader) -> Self {
        Self { name: name.to_owned(), sample_rate_hz, duration_s: None, samples: 0, reader }
    }

    fn live_stream(&self) -> Option<&LiveStream> {
        match &self.reader {
            SourceReader::Live(live) => Some(&live.stream),
            _ => None,
        }
    }

    /// Capture time of the sound at this position; `None` if not live.
    pub fn captured_at(&self, position_s: f64) -> Option<Instant> {
        self.live_stream()?.captured_at(position_s)
    }

    /// The next event of a live source that the user should know.
    pub fn next_event(&mut self) -> Option<CaptureEvent> {
        match &mut self.reader {
            SourceReader::Live(live) => live.stream.next_event(),
            _ => None,
        }
    }

    /// Totals of a live source; `None` if not live.
    pub fn capture_stats(&self) -> Option<CaptureStats> {
        Some(self.live_stream()?.stats())
    }

    /// Sample rate of the blocks, hertz.
    pub fn sample_rate_hz(&self) -> u32 {
        self.sample_rate_hz
    }

    /// Length in seconds, if the file states it.
    pub fn duration_s(&self) -> Option<f64> {
        self.duration_s
    }

    /// Position behind the newest block, seconds.
    pub fn position_s(&self) -> f64 {
        self.samples as f64 / f64::from(self.sample_rate_hz)
    }

    /// Number of broken packets skipped so far.
    pub fn skipped_packets(&self) -> u64 {
        match &self.reader {
            SourceReader::File(reader) => reader.skipped_packets(),
            SourceReader::Pcm(_) | SourceReader::Live(_) => 0,
        }
    }

    /// What a recording lacks, in words: broken packets, and, once its end was read, an end
    /// that came too early.
    pub fn damage(&self) -> Option<String> {
        match &self.reader {
            SourceReader::File(reader) => {
                reader.damage().map(|damage| format!("{}: {damage}", self.name))
            }
            SourceReader::Pcm(_) | SourceReader::Live(_) => None,
        }
    }

    /// Replaces the content of `block` by the next samples, -1 to 1. `false` at the
    /// end of the source, with an empty block. A live source from which nothing comes leaves
    /// the block empty as well, after [`LONGEST_WAIT`], so that the caller can look around.
    /// Errors: a source that breaks, or that ends before [`SHORTEST_S`].
    pub fn next_block(&mut self, block: &mut Vec<f32>) -> Result<bool, SourceError> {
        block.clear();
        let more = match &mut self.reader {
            SourceReader::File(reader) => reader.next_block(block)?,
            SourceReader::Pcm(reader) => reader.next_block(block)?,
            SourceReader::Live(live) => live.next_block(block)?,
        };
        self.samples += block.len() as u64;
        if !more && self.position_s() < SHORTEST_S {
            return Err(SourceFault::short(self.position_s()).of(&self.name));
        }
        Ok(more)
    }
}

impl LiveReader {
    fn next_block(&mut self, block: &mut Vec<f32>) -> Result<bool, SourceError> {
        let began = Instant::now();
        while self.stream.read(Instant::now(), block) {
            if !block.is_empty() || began.elapsed() > LONGEST_WAIT {
                return Ok(true);
            }
            std::thread::sleep(LIVE_POLL);
        }
        if !block.is_empty() {
            return Ok(true); // an error is returned after all sound before it
        }
        match self.failures.as_ref().and_then(|f| f.try_recv().ok()) {
            Some(error) => Err(error),
            None => Ok(false),
        }
    }
}

#[cfg(test)]
mod tests;
