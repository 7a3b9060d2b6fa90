//! What a follower and its leader tell each other about time.

use super::WireError;
use super::bytes::{Put, Take};
use super::frames::time;

/// A follower asks what time it is.
///
/// | bytes | type | what |
/// |---|---|---|
/// | 8 | u64 | follower: a random number that it drew when it began |
/// | 8 | u64 | instance of the leader that is asked |
/// | 8 | u64 | nonce: a random number, new in each question |
/// | 1 | u8 | voice of which it lacks frames that were sent before; 255: none |
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Question {
    /// Who asks.
    pub follower: u64,
    /// Who is asked.
    pub instance: u64,
    /// Comes back with the answer.
    pub nonce: u64,
    /// The voice of which frames are wanted that were sent already and are not
    /// yet over.
    pub lacks: Option<u8>,
}

/// No voice.
const NO_VOICE: u8 = u8::MAX;

impl Question {
    pub(super) fn write(&self, put: &mut Put) {
        put.u64(self.follower).u64(self.instance).u64(self.nonce);
        put.u8(self.lacks.unwrap_or(NO_VOICE));
    }

    pub(super) fn read(take: &mut Take) -> Result<Self, WireError> {
        Ok(Self {
            follower: take.u64()?,
            instance: take.u64()?,
            nonce: take.u64()?,
            lacks: Some(take.u8()?).filter(|voice| *voice != NO_VOICE),
        })
    }
}

/// The leader answers.
///
/// | bytes | type | what |
/// |---|---|---|
/// | 8 | u64 | instance of the leader |
/// | 8 | u64 | the nonce of the question |
/// | 8 | i64 | when the question came, nanoseconds of the leader's clock |
/// | 8 | i64 | when this answer was made, of the same |
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Who answers.
    pub instance: u64,
    /// Of the question.
    pub nonce: u64,
    /// When the question came.
    pub heard_ns: i64,
    /// When this answer was made.
    pub answered_ns: i64,
}

impl Answer {
    pub(super) fn write(&self, put: &mut Put) {
        put.u64(self.instance).u64(self.nonce);
        put.i64(self.heard_ns).i64(self.answered_ns);
    }

    pub(super) fn read(take: &mut Take) -> Result<Self, WireError> {
        Ok(Self {
            instance: take.u64()?,
            nonce: take.u64()?,
            heard_ns: time(take)?,
            answered_ns: time(take)?,
        })
    }
}

/// How a follower fares, so that the leader sends frames early enough.
///
/// | bytes | type | what |
/// |---|---|---|
/// | 8 | u64 | follower |
/// | 8 | u64 | instance of the leader that it follows |
/// | 4 | u32 | number of this report, one more for each |
/// | 2 | u16 | how long before its time a frame must be sent, milliseconds |
/// | 2 | u16 | the longest way of a frame of late, milliseconds |
/// | 4 | u32 | frames that never came |
/// | 1+n | name | name of the follower |
/// | 1+n | name | style that it would like; empty: any |
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// Who.
    pub follower: u64,
    /// Whom it follows.
    pub instance: u64,
    /// One more for each report.
    pub number: u32,
    /// How long before its time a frame must be sent, milliseconds.
    pub needed_ms: u16,
    /// The longest way of a frame of late, milliseconds.
    pub way_ms: u16,
    /// Frames that never came.
    pub lost: u32,
    /// Name of the follower.
    pub name: String,
    /// The style that it would like; empty: any.
    pub style: String,
}

impl Report {
    pub(super) fn write(&self, put: &mut Put) {
        put.u64(self.follower).u64(self.instance).u32(self.number);
        put.u16(self.needed_ms).u16(self.way_ms).u32(self.lost);
        put.name(&self.name).name(&self.style);
    }

    pub(super) fn read(take: &mut Take) -> Result<Self, WireError> {
        Ok(Self {
            follower: take.u64()?,
            instance: take.u64()?,
            number: take.u32()?,
            needed_ms: take.u16()?,
            way_ms: take.u16()?,
            lost: take.u32()?,
            name: take.name()?,
            style: take.name()?,
        })
    }
}
