//! Errors of sources of sound.

use std::io;

/// The shortest recording that can be danced to, seconds.
pub const SHORTEST_S: f64 = 0.5;

/// Why a source gives no music: one line that begins with the source's name.
#[derive(Debug, thiserror::Error)]
#[error("{name}: {fault}")]
pub struct SourceError {
    /// The path or name of the source as given by the user.
    pub name: String,
    /// The fault of that source.
    pub fault: SourceFault,
}

/// The fault of a source.
#[derive(Debug, thiserror::Error)]
pub enum SourceFault {
    /// The path leads nowhere.
    #[error("no such file")]
    NotFound,
    /// The system refuses to read it (a folder, no permission, a bad disk).
    #[error("cannot be read: {0}")]
    Unreadable(io::Error),
    /// The source holds not one byte.
    #[error("is empty")]
    Empty,
    /// The content is of none of the known kinds.
    #[error("is not an audio file (wav, flac, mp3 and ogg/vorbis can be read)")]
    NotAudio,
    /// A known container with a codec that is not built in; the decoder's words.
    #[error("its audio codec is not supported ({0}); convert it to wav or flac")]
    UnsupportedCodec(String),
    /// It looks like audio, but nothing in it can be decoded; the decoder's words.
    #[error("is corrupt: {0}")]
    Corrupt(String),
    /// Shorter than [`SHORTEST_S`]; its length in seconds.
    #[error("lasts {0:.2} s; at least {SHORTEST_S} s are needed")]
    TooShort(f64),
    /// The recording never rises above -80 dB of full scale.
    #[error("is silent from beginning to end")]
    Silent,
    /// The sample rate changes on the way, as in some joined streams.
    #[error("its sample rate changes from {from_hz} to {to_hz} Hz; convert it to one rate")]
    RateChange {
        /// The rate at the beginning, hertz.
        from_hz: u32,
        /// The rate after the change, hertz.
        to_hz: u32,
    },
    /// The raw format has no channels or an impossible rate.
    #[error(
        "raw audio needs 1 to 64 channels at 4000 to 384000 Hz, not {channels} at {sample_rate_hz} Hz"
    )]
    Format {
        /// The requested number of channels.
        channels: u16,
        /// The requested rate, hertz.
        sample_rate_hz: u32,
    },
}

impl SourceFault {
    pub(super) fn of(self, name: &str) -> SourceError {
        SourceError { name: name.to_owned(), fault: self }
    }

    pub(super) fn io(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::NotFound => Self::NotFound,
            _ => Self::Unreadable(error),
        }
    }

    pub(super) fn short(seconds: f64) -> Self {
        match seconds {
            0.0 => Self::Empty,
            _ => Self::TooShort(seconds),
        }
    }
}
