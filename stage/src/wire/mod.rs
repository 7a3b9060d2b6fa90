//! The messages of a stage: versioned, little-endian, of bounded size.
//!
//! Every message begins with the same four bytes:
//!
//! | bytes | what |
//! |---|---|
//! | 2 | `sd` |
//! | 1 | version of the format, now [`VERSION`] |
//! | 1 | kind: 1 frames, 2 question, 3 answer, 4 roles, 5 cue, 6 standing |
//!
//! What follows is documented at the type of each kind; docs/stage.md has all
//! of it. A name is one byte of length and so many bytes of UTF-8, at most
//! [`NAME_BYTES`]. A message with a byte too few or too many, a number that is
//! not finite or out of its range, another version or another kind is refused
//! whole.

mod bytes;
mod frames;
mod role;
mod time;

pub use frames::{Frames, MOST_FRAMES, StageFrame};
pub use role::{Cue, MOST_ROLES, Role, Roles};
pub use time::{Answer, Question, Report};

use bytes::{Put, Take};

/// The version of the format that is written, and the only one understood.
pub const VERSION: u8 = 2;
/// Longer messages are refused unread.
pub const MOST_BYTES: usize = 16 * 1024;
/// Longest name of a follower or a style, bytes.
pub const NAME_BYTES: usize = 48;

const MAGIC: [u8; 2] = *b"sd";

/// Why a message was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// Longer than any message is.
    #[error("{0} bytes are more than the {MOST_BYTES} that a message may have")]
    Huge(usize),
    /// It does not begin as our messages do.
    #[error("no message of a stage")]
    Foreign,
    /// Somebody speaks another version of the format.
    #[error(
        "message format {0} is not known here, only {VERSION}: leader and followers need the same version of servodance"
    )]
    Version(u8),
    /// A kind that this version does not have.
    #[error("no message has kind {0}")]
    Kind(u8),
    /// Cut off, or with something behind its end.
    #[error("message of a wrong length")]
    Length,
    /// A value that cannot be.
    #[error("{0} is out of its range")]
    Value(&'static str),
}

/// One message.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// Motion, leader to followers.
    Frames(Frames),
    /// What time is it? Follower to leader.
    Question(Question),
    /// So late. Leader to follower.
    Answer(Answer),
    /// Who dances how, leader to followers.
    Roles(Roles),
    /// Somebody wants a follower to dance otherwise; to the leader.
    Cue(Cue),
    /// How a follower fares, follower to leader.
    Report(Report),
}

impl Message {
    /// The bytes of it.
    pub fn encode(&self) -> Vec<u8> {
        let kind = match self {
            Message::Frames(_) => 1,
            Message::Question(_) => 2,
            Message::Answer(_) => 3,
            Message::Roles(_) => 4,
            Message::Cue(_) => 5,
            Message::Report(_) => 6,
        };
        let mut put = Put::new(&[MAGIC[0], MAGIC[1], VERSION, kind]);
        match self {
            Message::Frames(message) => message.write(&mut put),
            Message::Question(message) => message.write(&mut put),
            Message::Answer(message) => message.write(&mut put),
            Message::Roles(message) => message.write(&mut put),
            Message::Cue(message) => message.write(&mut put),
            Message::Report(message) => message.write(&mut put),
        }
        put.0
    }

    /// Reads one message, which is all of `bytes`.
    ///
    /// # Errors
    /// Anything but one whole message of this version.
    pub fn decode(bytes: &[u8]) -> Result<Self, WireError> {
        if bytes.len() > MOST_BYTES {
            return Err(WireError::Huge(bytes.len()));
        }
        let (version, kind, body) = match bytes {
            [a, b, version, kind, body @ ..] if [*a, *b] == MAGIC => (*version, *kind, body),
            _ => return Err(WireError::Foreign),
        };
        if version != VERSION {
            return Err(WireError::Version(version));
        }
        let mut take = Take(body);
        let message = match kind {
            1 => Message::Frames(Frames::read(&mut take)?),
            2 => Message::Question(Question::read(&mut take)?),
            3 => Message::Answer(Answer::read(&mut take)?),
            4 => Message::Roles(Roles::read(&mut take)?),
            5 => Message::Cue(Cue::read(&mut take)?),
            6 => Message::Report(Report::read(&mut take)?),
            _ => return Err(WireError::Kind(kind)),
        };
        match take.0.is_empty() {
            true => Ok(message),
            false => Err(WireError::Length),
        }
    }
}

#[cfg(test)]
mod tests;
