//! What can be wrong with a source of sound.

use std::io;

use super::SHORTEST_S;

/// Why a source gives no music. Every message is one line and names the source.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// The path leads nowhere.
    #[error("{name}: no such file")]
    NotFound {
        /// The path as given.
        name: String,
    },
    /// The system refuses to read it (a folder, no permission, a bad disk).
    #[error("{name}: cannot be read: {error}")]
    Unreadable {
        /// The path or name as given.
        name: String,
        /// What the system says.
        error: io::Error,
    },
    /// There is not one byte in it.
    #[error("{name}: is empty")]
    Empty {
        /// The path or name as given.
        name: String,
    },
    /// The content is of none of the known kinds.
    #[error("{name}: is not an audio file (wav, flac, mp3 and ogg/vorbis can be read)")]
    NotAudio {
        /// The path as given.
        name: String,
    },
    /// A known container with a codec that is not built in.
    #[error("{name}: its audio codec is not supported ({detail}); convert it to wav or flac")]
    UnsupportedCodec {
        /// The path as given.
        name: String,
        /// What the decoder says.
        detail: String,
    },
    /// It looks like audio, but nothing in it can be decoded.
    #[error("{name}: is corrupt: {detail}")]
    Corrupt {
        /// The path as given.
        name: String,
        /// What the decoder says.
        detail: String,
    },
    /// Too little to dance to.
    #[error("{name}: lasts {seconds:.2} s; at least {SHORTEST_S} s are needed")]
    TooShort {
        /// The path or name as given.
        name: String,
        /// Its length.
        seconds: f64,
    },
    /// There is nothing to hear in it.
    #[error("{name}: is silent from beginning to end")]
    Silent {
        /// The path as given.
        name: String,
    },
    /// The sample rate changes on the way, as in some joined streams.
    #[error("{name}: its sample rate changes from {from_hz} to {to_hz} Hz; convert it to one rate")]
    RateChange {
        /// The path as given.
        name: String,
        /// The rate at the beginning.
        from_hz: u32,
        /// The rate after it.
        to_hz: u32,
    },
    /// No input of the system has this id or name.
    #[error("no microphone \"{name}\"; there are: {}", list(.known))]
    UnknownDevice {
        /// The name as given.
        name: String,
        /// Ids of those there are.
        known: Vec<String>,
    },
    /// An input of the system cannot be opened or asked.
    #[error("{name}: {reason}")]
    Device {
        /// What it is called.
        name: String,
        /// What the system says, in one line.
        reason: String,
    },
    /// The raw format has no channels or an impossible rate.
    #[error(
        "{name}: raw audio needs 1 to 64 channels at 4000 to 384000 Hz, not {channels} at {sample_rate_hz} Hz"
    )]
    Format {
        /// The name as given.
        name: String,
        /// Channels asked for.
        channels: u16,
        /// Rate asked for.
        sample_rate_hz: u32,
    },
}

impl SourceError {
    pub(super) fn io(name: &str, error: io::Error) -> Self {
        let name = name.to_owned();
        match error.kind() {
            io::ErrorKind::NotFound => Self::NotFound { name },
            _ => Self::Unreadable { name, error },
        }
    }

    pub(super) fn short(name: &str, seconds: f64) -> Self {
        let name = name.to_owned();
        if seconds == 0.0 {
            Self::Empty { name }
        } else {
            Self::TooShort { name, seconds }
        }
    }
}

fn list(names: &[String]) -> String {
    match names {
        [] => "none".to_owned(),
        names => names.join(", "),
    }
}
