//! The music of a dance, whatever it comes from, as mono blocks.

use super::config::AudioChoice;
use servodance_audio::AudioSource;
use servodance_audio::song::Song;

/// Samples that the built-in song is handed over in.
const BLOCK: usize = 1024;

/// An open source of music.
pub enum Audio {
    /// A recording or raw PCM.
    Source(Box<AudioSource>),
    /// The built-in song, and how much of it was heard.
    BuiltIn(Box<Song>, usize),
}

impl Audio {
    /// Opens what was chosen; refuses what cannot be danced to.
    pub fn open(choice: &AudioChoice) -> anyhow::Result<Self> {
        Ok(match choice {
            AudioChoice::BuiltIn => Audio::BuiltIn(Box::new(Song::demo()), 0),
            AudioChoice::File(path) => Audio::Source(Box::new(AudioSource::open(path)?)),
            AudioChoice::Stdin(format) => Audio::Source(Box::new(AudioSource::from_reader(
                "standard input",
                std::io::stdin(),
                *format,
            )?)),
        })
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
