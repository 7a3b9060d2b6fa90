//! Who dances how: mirror, canon, amplitude, style.

use super::WireError;
use super::bytes::{Put, Take};

/// Roles in one message at most.
pub const MOST_ROLES: usize = 64;
/// The longest canon, beats.
const MOST_BEATS: f32 = 64.0;

/// What a follower does otherwise than it was started; `None`: as it was.
///
/// | bytes | type | what |
/// |---|---|---|
/// | 1 | u8 | which are set: bit 0 mirror, 1 amplitude, 2 canon, 3 style |
/// | 1 | u8 | mirror: 0 or 1 |
/// | 4 | f32 | amplitude, 0 to 1 |
/// | 4 | f32 | canon: beats later than the leader, 0 to 64 |
/// | 1+n | name | style |
///
/// What is not set is written as zero, or as an empty name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Role {
    /// Whether it is the dancer's mirror image.
    pub mirror: Option<bool>,
    /// Share of the movement, 0 to 1.
    pub amplitude: Option<f32>,
    /// Beats later than the leader.
    pub canon_beats: Option<f32>,
    /// Style of the dance.
    pub style: Option<String>,
}

impl Role {
    /// Takes over what `other` sets.
    pub fn take(&mut self, other: &Role) {
        self.mirror = other.mirror.or(self.mirror);
        self.amplitude = other.amplitude.or(self.amplitude);
        self.canon_beats = other.canon_beats.or(self.canon_beats);
        if other.style.is_some() {
            self.style.clone_from(&other.style);
        }
    }

    /// The role if each value is in its range.
    ///
    /// # Errors
    /// The first that is not.
    pub fn checked(self) -> Result<Self, WireError> {
        let out = |value: Option<f32>, most: f32| value.is_some_and(|v| !(0.0..=most).contains(&v));
        if out(self.amplitude, 1.0) {
            return Err(WireError::Value("an amplitude (0 to 1)"));
        }
        if out(self.canon_beats, MOST_BEATS) {
            return Err(WireError::Value("a canon (0 to 64 beats)"));
        }
        match &self.style {
            Some(style) if !crate::keys::is_plain(style) => Err(WireError::Value("a style")),
            _ => Ok(self),
        }
    }

    fn write(&self, put: &mut Put) {
        let set = [
            self.mirror.is_some(),
            self.amplitude.is_some(),
            self.canon_beats.is_some(),
            self.style.is_some(),
        ];
        let bits = set
            .iter()
            .rev()
            .fold(0, |bits, set| bits << 1 | u8::from(*set));
        put.u8(bits).u8(u8::from(self.mirror.unwrap_or_default()));
        put.f32(self.amplitude.unwrap_or_default());
        put.f32(self.canon_beats.unwrap_or_default());
        put.name(self.style.as_deref().unwrap_or_default());
    }

    fn read(take: &mut Take) -> Result<Self, WireError> {
        let (bits, mirror) = (take.u8()?, take.u8()?);
        let (amplitude, canon) = (take.f32()?, take.f32()?);
        let style = take.name()?;
        if bits > 15 || mirror > 1 {
            return Err(WireError::Value("a role"));
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

/// All roles that differ from how their followers were started; sent when one
/// changes, and again every second for those who come late.
///
/// | bytes | type | what |
/// |---|---|---|
/// | 8 | u64 | instance of the leader |
/// | 4 | u32 | term of the leader |
/// | 8 | u64 | number of this message, one more for each |
/// | 1 | u8 | how many roles: 0 to 64 |
/// | each | | name of the follower (`all`: everybody), then its [`Role`] |
#[derive(Clone, Debug, PartialEq)]
pub struct Roles {
    /// Which leader.
    pub instance: u64,
    /// How many leaders took over before it.
    pub term: u32,
    /// One more for each message.
    pub number: u64,
    /// Names and roles.
    pub roles: Vec<(String, Role)>,
}

impl Roles {
    pub(super) fn write(&self, put: &mut Put) {
        put.u64(self.instance).u32(self.term).u64(self.number);
        let count = self.roles.len().min(MOST_ROLES);
        put.u8(count as u8);
        for (name, role) in &self.roles[..count] {
            put.name(name);
            role.write(put);
        }
    }

    pub(super) fn read(take: &mut Take) -> Result<Self, WireError> {
        let (instance, term, number) = (take.u64()?, take.u32()?, take.u64()?);
        let count = usize::from(take.u8()?);
        if count > MOST_ROLES {
            return Err(WireError::Value("the number of roles"));
        }
        let each = (0..count).map(|_| Ok((take.name()?, Role::read(take)?)));
        Ok(Self {
            roles: each.collect::<Result<_, WireError>>()?,
            instance,
            term,
            number,
        })
    }
}

/// Somebody wants a follower to dance otherwise.
///
/// | bytes | type | what |
/// |---|---|---|
/// | 8 | u64 | nonce: a random number; the same one is heeded once |
/// | 1+n | name | name of the follower; `all`: everybody |
/// | | | the [`Role`] |
#[derive(Clone, Debug, PartialEq)]
pub struct Cue {
    /// Heeded once.
    pub nonce: u64,
    /// Who shall; `all`: everybody.
    pub follower: String,
    /// What.
    pub role: Role,
}

impl Cue {
    pub(super) fn write(&self, put: &mut Put) {
        put.u64(self.nonce).name(&self.follower);
        self.role.write(put);
    }

    pub(super) fn read(take: &mut Take) -> Result<Self, WireError> {
        Ok(Self {
            nonce: take.u64()?,
            follower: take.name()?,
            role: Role::read(take)?,
        })
    }
}
