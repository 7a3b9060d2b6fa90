//! The music of a dance, whatever it comes from, as mono blocks.

use crate::pipeline::microphone::microphone;
use crate::process::failpoint::{self, FailpointReader};
use crate::session::config::{AudioChoice, Speed};
use servodance_audio::AudioSource;
use servodance_audio::capture::{CaptureEvent, CaptureStats};
use servodance_audio::song::Song;
use std::time::Instant;

/// Samples that the built-in song is handed over in.
const BLOCK: usize = 1024;

/// An open source of music.
pub enum Audio {
    /// A recording, raw PCM or a microphone.
    Source(Box<AudioSource>),
    /// The built-in song, and how much of it was heard.
    BuiltIn(Box<Song>, usize),
}

impl Audio {
    /// Opens what was chosen; refuses what cannot be danced to.
    pub fn open(choice: &AudioChoice, speed: Speed) -> anyhow::Result<Self> {
        let open_pipe = match choice.is_live(speed) {
            true => AudioSource::live_reader,
            false => AudioSource::from_reader,
        };
        let source = match choice {
            AudioChoice::BuiltIn => return Ok(Audio::BuiltIn(Box::new(Song::demo()), 0)),
            AudioChoice::File(path) => AudioSource::open(path)?,
            AudioChoice::Stdin(format) => {
                let (reader, place) = (std::io::stdin(), "pipe");
                open_pipe("standard input", FailpointReader { reader, place }, *format)?
            }
            AudioChoice::Microphone(name) => microphone(name.as_deref())?,
        };
        Ok(Audio::Source(Box::new(source)))
    }

    /// Whether sound comes in as it happens.
    pub fn is_live(&self) -> bool {
        self.capture_stats().is_some()
    }

    /// When the sound at this position was captured; `None` if not live.
    pub fn captured_at(&self, position_s: f64) -> Option<Instant> {
        match self {
            Audio::Source(source) => source.captured_at(position_s),
            Audio::BuiltIn(..) => None,
        }
    }

    /// The next thing about live sound that the user should know.
    pub fn next_notice(&mut self) -> Option<CaptureEvent> {
        match self {
            Audio::Source(source) => source.next_event(),
            Audio::BuiltIn(..) => None,
        }
    }

    /// Totals of live sound.
    pub fn capture_stats(&self) -> Option<CaptureStats> {
        match self {
            Audio::Source(source) => source.capture_stats(),
            Audio::BuiltIn(..) => None,
        }
    }

    /// Samples a second.
    pub fn sample_rate_hz(&self) -> u32 {
        match self {
            Audio::Source(source) => source.sample_rate_hz(),
            Audio::BuiltIn(song, _) => song.sample_rate_hz,
        }
    }

    /// Length in seconds, where it is known beforehand.
    pub fn duration_s(&self) -> Option<f64> {
        match self {
            Audio::Source(source) => source.duration_s(),
            Audio::BuiltIn(song, _) => Some(song.duration_s()),
        }
    }

    /// The next samples replace `block`; `false` at the end.
    pub fn next_block(&mut self, block: &mut Vec<f32>) -> anyhow::Result<bool> {
        failpoint::pass("audio");
        match self {
            Audio::Source(source) => Ok(source.next_block(block)?),
            Audio::BuiltIn(song, heard) => {
                let end = song.samples.len().min(*heard + BLOCK);
                block.clear();
                block.extend_from_slice(&song.samples[*heard..end]);
                *heard = end;
                Ok(!block.is_empty())
            }
        }
    }
}
