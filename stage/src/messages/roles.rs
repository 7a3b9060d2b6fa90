//! Roles: mirror, canon, amplitude and style of each follower.

use super::codec::{ByteReader, Field, is_valid_name, message_struct};
use super::error::MessageError;

/// Largest number of roles or names in one message.
pub(crate) const MAX_ROLES: usize = 64;
/// The longest canon, beats.
const MOST_BEATS: f32 = 64.0;

/// Changes to the role with which a follower was started; `None`: unchanged.
///
/// | bytes | type | value |
/// | ---: | --- | :--- |
/// | 1 | u8 | set fields: bit 0 mirror, 1 amplitude, 2 canon, 3 style |
/// | 1 | u8 | mirror: 0 or 1 |
/// | 4 | f32 | amplitude, 0 to 1 |
/// | 4 | f32 | canon: beats later than the leader, 0 to 64 |
/// | 1+n | name | style |
///
/// A field that is not set is written as zero, or as an empty name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Role {
    /// Whether the robot dances the mirror image.
    pub mirror: Option<bool>,
    /// Share of the movement, 0 to 1.
    pub amplitude: Option<f32>,
    /// Delay against the leader, beats.
    pub canon_beats: Option<f32>,
    /// Name of the style.
    pub style: Option<String>,
}

impl Role {
    /// Replaces the values that `other` sets.
    pub fn update(&mut self, other: &Role) {
        self.mirror = other.mirror.or(self.mirror);
        self.amplitude = other.amplitude.or(self.amplitude);
        self.canon_beats = other.canon_beats.or(self.canon_beats);
        if other.style.is_some() {
            self.style.clone_from(&other.style);
        }
    }

    /// The role if each value is in its range.
    /// Errors: the first value that is not.
    pub fn checked(self) -> Result<Self, MessageError> {
        let out = |value: Option<f32>, most: f32| value.is_some_and(|v| !(0.0..=most).contains(&v));
        if out(self.amplitude, 1.0) {
            return Err(MessageError::Value("an amplitude (0 to 1)"));
        }
        if out(self.canon_beats, MOST_BEATS) {
            return Err(MessageError::Value("a canon (0 to 64 beats)"));
        }
        match &self.style {
            Some(style) if !is_valid_name(style) => Err(MessageError::Value("a style")),
            _ => Ok(self),
        }
    }
}

impl Field for Role {
    fn write(&self, out: &mut Vec<u8>) {
        let bits = u8::from(self.mirror.is_some())
            | u8::from(self.amplitude.is_some()) << 1
            | u8::from(self.canon_beats.is_some()) << 2
            | u8::from(self.style.is_some()) << 3;
        bits.write(out);
        u8::from(self.mirror.unwrap_or_default()).write(out);
        self.amplitude.unwrap_or_default().write(out);
        self.canon_beats.unwrap_or_default().write(out);
        self.style.clone().unwrap_or_default().write(out);
    }

    fn read(input: &mut ByteReader) -> Result<Self, MessageError> {
        let (bits, mirror): (u8, u8) = (input.get()?, input.get()?);
        let (amplitude, canon) = (input.get()?, input.get()?);
        let style = input.get()?;
        if bits > 15 || mirror > 1 {
            return Err(MessageError::Value("a role"));
        }
        let set = |bit: u8| bits & (1 << bit) > 0;
        let role = Self {
            mirror: set(0).then_some(mirror == 1),
            amplitude: set(1).then_some(amplitude),
            canon_beats: set(2).then_some(canon),
            style: set(3).then_some(style),
        };
        role.checked()
    }
}

message_struct! {
/// All roles that differ from how their followers were started; sent when one
/// changes, and again every second for followers that join late.
#[derive(Clone, Debug, PartialEq)]
pub struct Roles {
    /// Instance of the leader.
    pub instance: u64,
    /// Number of leaders that led before this one.
    pub term: u32,
    /// Number of this message, one more for each.
    pub number: u64,
    /// Names of followers (`all`: everybody) and their [`Role`]s; their number,
    /// 0 to 64, in one byte before.
    pub roles: Vec<(String, Role)>,
}
}

message_struct! {
/// A request to change the role of a follower; anybody may send one to the leader.
#[derive(Clone, Debug, PartialEq)]
pub struct Cue {
    /// Random number; the leader obeys each number once.
    pub nonce: u64,
    /// Name of the follower; `all`: everybody.
    pub follower: String,
    /// The change of the role.
    pub role: Role,
}
}

message_struct! {
/// The leader's answer to a cue.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CueReply {
    /// The nonce of the cue.
    pub nonce: u64,
    /// Followers that the cue reaches.
    pub reached: u16,
    /// Names of the followers that there are, as far as one message has room; their
    /// number, 0 to 64, in one byte before.
    pub names: Vec<String>,
}
}

impl Field for (String, Role) {
    fn write(&self, out: &mut Vec<u8>) {
        self.0.write(out);
        self.1.write(out);
    }

    fn read(input: &mut ByteReader) -> Result<Self, MessageError> {
        Ok((input.get()?, input.get()?))
    }
}

impl<T: Field> Field for Vec<T> {
    fn write(&self, out: &mut Vec<u8>) {
        let listed = &self[..self.len().min(MAX_ROLES)];
        (listed.len() as u8).write(out);
        listed.iter().for_each(|one| one.write(out));
    }

    fn read(input: &mut ByteReader) -> Result<Self, MessageError> {
        let count = usize::from(input.get::<u8>()?);
        if count > MAX_ROLES {
            return Err(MessageError::Value("the length of a list"));
        }
        (0..count).map(|_| input.get()).collect()
    }
}
