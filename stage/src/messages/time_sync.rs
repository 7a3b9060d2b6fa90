//! Clock synchronization: a follower's request, the leader's reply, and the report
//! by which a follower tells the leader how early frames must be sent.

use super::codec::{ByteReader, Field, message_struct};
use super::error::MessageError;

/// Stands for no channel.
const NO_CHANNEL: u8 = u8::MAX;

message_struct! {
/// A follower asks the leader for its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeRequest {
    /// Random number that the follower drew when it started.
    pub follower: u64,
    /// Instance of the leader that is asked.
    pub instance: u64,
    /// Random number, new in each request; the reply repeats it.
    pub nonce: u64,
    /// Channel whose frames are wanted that were sent already and are not over
    /// yet, one byte; 255: none.
    pub resend: Option<u8>,
}
}

message_struct! {
/// The leader replies with its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeReply {
    /// Instance of the leader that replies.
    pub instance: u64,
    /// The nonce of the request.
    pub nonce: u64,
    /// Arrival of the request, nanoseconds of the leader's clock.
    pub received_ns: i64,
    /// Departure of this reply, nanoseconds of the leader's clock.
    pub replied_ns: i64,
}
}

message_struct! {
/// State of a follower, so that the leader sends frames early enough.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FollowerReport {
    /// The follower's random number.
    pub follower: u64,
    /// Instance of the leader that it follows.
    pub instance: u64,
    /// Number of this report, one more for each.
    pub number: u32,
    /// How long before its time a frame must be sent, milliseconds.
    pub needed_ms: u16,
    /// The longest recent transit of a frame, milliseconds.
    pub transit_ms: u16,
    /// Number of frames that never arrived.
    pub lost: u32,
    /// Name of the follower.
    pub name: String,
    /// The style that the follower prefers; empty: any.
    pub style: String,
}
}

impl Field for Option<u8> {
    fn write(&self, out: &mut Vec<u8>) {
        out.push(self.unwrap_or(NO_CHANNEL));
    }

    fn read(input: &mut ByteReader) -> Result<Self, MessageError> {
        Ok(Some(input.get()?).filter(|channel| *channel != NO_CHANNEL))
    }
}
