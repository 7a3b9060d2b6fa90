//! The messages of a stage: versioned, little-endian, of bounded size.
//!
//! Every message begins with the same four bytes: `sd`, the version of the format
//! (now 2), and the kind: 1 frames, 2 time request, 3 time reply,
//! 4 roles, 5 cue, 6 follower report, 7 cue reply, 8 stage stop. The rest are the fields of its type, in
//! order; docs/stage.md has all of them. A name is one byte of length and UTF-8,
//! at most 48. A message with a byte too few or too many, a number
//! that is not finite or out of its range, another version or another kind is
//! refused whole.

mod codec;
mod error;
mod frames;
mod roles;
mod stop;
mod time_sync;

pub use codec::is_valid_name;
pub use error::MessageError;
pub use frames::{Frames, StageFrame};
pub use roles::{Cue, CueReply, Role, Roles};
pub use stop::StageStop;
pub use time_sync::{FollowerReport, TimeReply, TimeRequest};

pub(crate) use error::MAX_BYTES;
pub(crate) use frames::MAX_FRAMES;
pub(crate) use roles::MAX_ROLES;

use codec::{ByteReader, Field};
use error::VERSION;

/// Longest message about a follower's robot, bytes: JSON for the leader's page, behind the
/// follower's id.
pub const MAX_LOOK_BYTES: usize = 256 * 1024;

const MAGIC: [u8; 2] = *b"sd";

macro_rules! messages {
    ($($(#[$doc:meta])* $kind:literal $name:ident($type:ty),)*) => {
        /// One message of any kind.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Message {
            $($(#[$doc])* $name($type),)*
        }

        impl Message {
            fn write(&self, out: &mut Vec<u8>) {
                match self {
                    $(Message::$name(message) => {
                        out.push($kind);
                        message.write(out);
                    })*
                }
            }

            fn read(kind: u8, body: &mut ByteReader) -> Result<Self, MessageError> {
                match kind {
                    $($kind => body.get().map(Message::$name),)*
                    _ => Err(MessageError::Kind(kind)),
                }
            }
        }
    };
}

messages! {
    /// Motion, leader to followers.
    1 Frames(Frames),
    /// Request for the leader's time, follower to leader.
    2 TimeRequest(TimeRequest),
    /// The leader's time, leader to follower.
    3 TimeReply(TimeReply),
    /// The roles of all followers, leader to followers.
    4 Roles(Roles),
    /// Request to change a role, anybody to leader.
    5 Cue(Cue),
    /// State of a follower, follower to leader.
    6 FollowerReport(FollowerReport),
    /// Whom a cue reaches, leader to whoever sent the cue.
    7 CueReply(CueReply),
    /// Torque off everywhere, leader to followers.
    8 StageStop(StageStop),
}

impl Message {
    /// Encodes the message with its header.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = vec![MAGIC[0], MAGIC[1], VERSION];
        self.write(&mut bytes);
        bytes
    }

    /// Decodes one message, which is all of `bytes`.
    /// Errors: anything but one whole message of this version.
    pub fn decode(bytes: &[u8]) -> Result<Self, MessageError> {
        if bytes.len() > MAX_BYTES {
            return Err(MessageError::Huge(bytes.len()));
        }
        let (version, kind, body) = match bytes {
            [a, b, version, kind, body @ ..] if [*a, *b] == MAGIC => (*version, *kind, body),
            _ => return Err(MessageError::Foreign),
        };
        if version != VERSION {
            return Err(MessageError::Version(version));
        }
        let mut body = ByteReader(body);
        let message = Message::read(kind, &mut body)?;
        match body.0.is_empty() {
            true => Ok(message),
            false => Err(MessageError::Length),
        }
    }
}

#[cfg(test)]
mod tests;
