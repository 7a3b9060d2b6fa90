//! The music of a dance as mono blocks, wherever it comes from.
//!
//! A microphone or a live pipe that stalls does not block the dance: the audio
//! crate (`servodance_audio::capture`) fills the hole with silence and gives a
//! notice, and the robot idles while it lasts.

use super::microphone::microphone;
use super::page_sound::PageSound;
use super::shared_pipe::standard_input;
use crate::process::failpoint::{self, FailpointReader};
use crate::process::speed::Speed;
use servodance_audio::AudioSource;
use servodance_audio::capture::{CaptureEvent, CaptureStats};
use servodance_audio::playback::Sound;
use servodance_audio::song::Song;
use servodance_audio::source::PcmFormat;
use std::path::PathBuf;
use std::time::Instant;

/// Samples in a block of the built-in song.
const BLOCK: usize = 1024;

/// Where the music comes from.
#[derive(Clone, Debug)]
pub enum AudioChoice {
    /// The song rendered by this program.
    BuiltIn,
    /// An audio file (WAV, FLAC, MP3, Ogg).
    File(PathBuf),
    /// Raw PCM on standard input.
    Stdin(PcmFormat),
    /// An input of the system by id or name; the default one if `None`.
    Microphone(Option<String>),
    /// The song of a recording of a dance.
    Recorded(Sound),
    /// What a page hears by the microphone of its browser.
    Page(PageSound),
}

impl AudioChoice {
    /// Whether all of it is there from the beginning.
    pub fn is_recording(&self) -> bool {
        matches!(self, AudioChoice::BuiltIn | AudioChoice::File(_) | AudioChoice::Recorded(_))
    }

    /// Whether sound comes in as it happens, without a look ahead.
    pub fn is_live(&self, speed: Speed) -> bool {
        match self {
            AudioChoice::BuiltIn | AudioChoice::File(_) | AudioChoice::Recorded(_) => false,
            AudioChoice::Stdin(_) => speed == Speed::Realtime,
            AudioChoice::Microphone(_) | AudioChoice::Page(_) => true,
        }
    }
}

pub(crate) enum AudioInput {
    Source(Box<AudioSource>),
    BuiltIn { song: Box<Song>, read: usize },
    Recorded { sound: Sound, read: usize },
}

impl AudioInput {
    /// Opens what was chosen; refuses what cannot be danced to.
    pub fn open(choice: &AudioChoice, speed: Speed) -> anyhow::Result<Self> {
        let open_pipe = match choice.is_live(speed) {
            true => AudioSource::live_reader,
            false => AudioSource::from_reader,
        };
        let source = match choice {
            AudioChoice::BuiltIn => return Ok(Self::song(Song::demo())),
            AudioChoice::Recorded(sound) => {
                return Ok(Self::Recorded { sound: sound.clone(), read: 0 });
            }
            AudioChoice::File(path) => AudioSource::open(path)?,
            AudioChoice::Stdin(format) => {
                let (reader, place) = (standard_input().reader(format.frame_bytes()), "pipe");
                open_pipe("standard input", FailpointReader { reader, place }, *format)?
            }
            AudioChoice::Microphone(name) => microphone(name.as_deref())?,
            AudioChoice::Page(sound) => {
                AudioSource::live_reader("the page's microphone", sound.reader(), sound.format())?
            }
        };
        Ok(Self::Source(Box::new(source)))
    }

    pub fn song(song: Song) -> Self {
        Self::BuiltIn { song: Box::new(song), read: 0 }
    }

    fn source(&self) -> Option<&AudioSource> {
        match self {
            Self::Source(source) => Some(source),
            Self::BuiltIn { .. } | Self::Recorded { .. } => None,
        }
    }

    pub fn is_live(&self) -> bool {
        self.capture_stats().is_some()
    }

    /// When the sound at this position was captured; `None` if not live.
    pub fn captured_at(&self, position_s: f64) -> Option<Instant> {
        self.source()?.captured_at(position_s)
    }

    /// What a recording lacks, in words.
    pub fn damage(&self) -> Option<String> {
        self.source()?.damage()
    }

    /// The next thing about live sound that the user should know.
    pub fn next_notice(&mut self) -> Option<CaptureEvent> {
        match self {
            Self::Source(source) => source.next_event(),
            Self::BuiltIn { .. } | Self::Recorded { .. } => None,
        }
    }

    /// Totals of live sound; `None` if not live.
    pub fn capture_stats(&self) -> Option<CaptureStats> {
        self.source()?.capture_stats()
    }

    pub fn sample_rate_hz(&self) -> u32 {
        match self {
            Self::Source(source) => source.sample_rate_hz(),
            Self::BuiltIn { song, .. } => song.sample_rate_hz,
            Self::Recorded { sound, .. } => sound.rate_hz,
        }
    }

    /// Length in seconds, where it is known beforehand.
    pub fn duration_s(&self) -> Option<f64> {
        match self {
            Self::Source(source) => source.duration_s(),
            Self::BuiltIn { song, .. } => Some(song.duration_s()),
            Self::Recorded { sound, .. } => {
                Some(sound.samples.len() as f64 / f64::from(sound.rate_hz))
            }
        }
    }

    /// The next samples replace `block`; `false` at the end.
    pub fn next_block(&mut self, block: &mut Vec<f32>) -> anyhow::Result<bool> {
        failpoint::pass("audio");
        match self {
            Self::Source(source) => Ok(source.next_block(block)?),
            Self::BuiltIn { song, read } => {
                let end = song.samples.len().min(*read + BLOCK);
                block.clear();
                block.extend_from_slice(&song.samples[*read..end]);
                *read = end;
                Ok(!block.is_empty())
            }
            Self::Recorded { sound, read } => {
                let end = sound.samples.len().min(*read + BLOCK);
                let level = |sample: &i16| f32::from(*sample) / f32::from(i16::MAX);
                block.clear();
                block.extend(sound.samples[*read..end].iter().map(level));
                *read = end;
                Ok(!block.is_empty())
            }
        }
    }
}
