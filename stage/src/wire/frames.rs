//! Motion on the network: the newest frame and the few before it.

use super::WireError;
use super::bytes::{Put, Take};
use servodance_types::{Beat, BeatLock, Contacts, JOINT_COUNT, MotionFrame, MusicFrame, Posture};

/// Frames in one message at most.
pub const MOST_FRAMES: usize = 8;
/// Points farther away than this are no dancer, metres.
const FARTHEST_M: f32 = 1000.0;
/// No posture has larger numbers: radians, leg lengths.
const WIDEST: f32 = 100.0;
/// No sound is louder or softer than this, in units of 20 dB.
const LOUDEST: f32 = 1000.0;
/// No music is faster than this, beats a minute.
const FASTEST_BPM: f32 = 1000.0;
/// Times are within a hundred years of zero, nanoseconds.
const FARTHEST_NS: i64 = 3_200_000_000_000_000_000;
/// Where the level stands in the music features.
const LEVEL: usize = 1;

/// One motion frame with the music that it was made for.
///
/// | bytes | type | what |
/// |---|---|---|
/// | 8 | i64 | when the servos shall show it, nanoseconds of the leader's clock |
/// | 8 | i64 | its moment in the music, nanoseconds |
/// | 4 | f32 | beat phase, 0 (on the beat) to 1 |
/// | 4 | f32 | tempo, beats a minute; 0 while unknown |
/// | 4 | f32 | confidence of the beat, 0 to 1 |
/// | 4 | f32 | presence of music, 0 to 1 |
/// | 4 | f32 | level, in units of 20 dB as in the music features |
/// | 1 | u8 | beat: 0 lost, 1 locked, 2 holding |
/// | 1 | u8 | feet on the floor: bit 0 left, bit 1 right |
/// | 264 | 66 f32 | x, y (up), z of the 22 joints, metres |
/// | 40 | 10 f32 | usual posture: heading, nod (2), sway (2), left foot (2), right foot (2), floor |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageFrame {
    /// When the servos shall show it, nanoseconds of the leader's clock.
    pub present_ns: i64,
    /// Its moment in the music, nanoseconds.
    pub music_ns: i64,
    /// The beat at that moment.
    pub beat: Beat,
    /// How sure it is that there is music, 0 to 1.
    pub presence: f32,
    /// Level, in units of 20 dB.
    pub level: f32,
    /// Feet on the floor.
    pub contacts: Contacts,
    /// Joint positions, metres.
    pub positions: [[f32; 3]; JOINT_COUNT],
    /// What is usual for the dancer; everybody sees movement against this.
    pub posture: Posture,
}

impl StageFrame {
    /// A frame of the dance that shall be seen at `present_ns`.
    pub fn new(
        present_ns: i64,
        music: &MusicFrame,
        motion: &MotionFrame,
        posture: Posture,
    ) -> Self {
        Self {
            present_ns,
            music_ns: (motion.time_s * 1e9).round() as i64,
            beat: music.beat,
            presence: music.presence,
            level: music.spectral[LEVEL],
            contacts: motion.contacts,
            positions: motion.positions,
            posture,
        }
    }

    /// The motion, at `time_s` of somebody's time.
    pub fn motion(&self, time_s: f64) -> MotionFrame {
        MotionFrame {
            time_s,
            positions: self.positions,
            contacts: self.contacts,
        }
    }

    /// What is known of the music, at `time_s` of somebody's time.
    pub fn music(&self, time_s: f64) -> MusicFrame {
        let mut music = MusicFrame {
            time_s,
            beat: self.beat,
            presence: self.presence,
            ..MusicFrame::default()
        };
        music.spectral[LEVEL] = self.level;
        music
    }

    fn write(&self, put: &mut Put) {
        let beat = self.beat;
        put.i64(self.present_ns).i64(self.music_ns);
        put.f32(beat.phase).f32(beat.tempo_bpm).f32(beat.confidence);
        put.f32(self.presence).f32(self.level);
        put.u8(match beat.lock {
            BeatLock::Lost => 0,
            BeatLock::Locked => 1,
            BeatLock::Holding => 2,
        });
        put.u8(u8::from(self.contacts.left) | u8::from(self.contacts.right) << 1);
        for value in self.positions.as_flattened() {
            put.f32(*value);
        }
        let posture = &self.posture;
        let [left, right] = posture.feet;
        put.f32(posture.heading_rad);
        for value in [posture.nod_rad, posture.sway, left, right].as_flattened() {
            put.f32(*value);
        }
        put.f32(posture.floor_m);
    }

    fn read(take: &mut Take) -> Result<Self, WireError> {
        let (present_ns, music_ns) = (time(take)?, time(take)?);
        let mut beat = Beat {
            phase: take.within(1.0, "the phase of a beat")?,
            tempo_bpm: take.within(FASTEST_BPM, "a tempo")?,
            confidence: take.within(1.0, "the confidence of a beat")?,
            ..Beat::default()
        };
        let presence = take.within(1.0, "the presence of music")?;
        let level = take.within(LOUDEST, "a level")?;
        beat.lock = match take.u8()? {
            0 => BeatLock::Lost,
            1 => BeatLock::Locked,
            2 => BeatLock::Holding,
            _ => return Err(WireError::Value("the state of a beat")),
        };
        let feet = take.u8()?;
        if feet > 3 {
            return Err(WireError::Value("feet on the floor"));
        }
        let mut positions = [[0.0; 3]; JOINT_COUNT];
        for value in positions.as_flattened_mut() {
            *value = take.within(FARTHEST_M, "a joint")?;
        }
        let posture = posture(take)?;
        Ok(Self {
            present_ns,
            music_ns,
            beat,
            presence,
            level,
            contacts: Contacts {
                left: feet & 1 > 0,
                right: feet & 2 > 0,
            },
            positions,
            posture,
        })
    }
}

fn posture(take: &mut Take) -> Result<Posture, WireError> {
    let heading_rad = take.within(WIDEST, "a heading")?;
    let mut pairs = [[0.0; 2]; 4];
    for value in pairs.as_flattened_mut() {
        *value = take.within(WIDEST, "a posture")?;
    }
    let [nod_rad, sway, left, right] = pairs;
    Ok(Posture {
        heading_rad,
        nod_rad,
        sway,
        feet: [left, right],
        floor_m: take.within(FARTHEST_M, "a floor")?,
    })
}

/// A time that can be calculated with.
pub(super) fn time(take: &mut Take) -> Result<i64, WireError> {
    let time_ns = take.i64()?;
    match time_ns.unsigned_abs() <= FARTHEST_NS.unsigned_abs() {
        true => Ok(time_ns),
        false => Err(WireError::Value("a time")),
    }
}

/// The newest frame of a voice and the few before it, so that a message that
/// is lost loses nothing.
///
/// | bytes | type | what |
/// |---|---|---|
/// | 8 | u64 | instance: a random number that the leader drew when it began |
/// | 4 | u32 | term: how many leaders took over before it |
/// | 8 | u64 | number of the newest frame; one more for each |
/// | 8 | i64 | when this was sent, nanoseconds of the leader's clock |
/// | 2 | u16 | how long before their time frames are sent, milliseconds |
/// | 1 | u8 | voice: 0 the stage's own style, others for followers that want another |
/// | 1+n | name | style of the voice |
/// | 1 | u8 | how many frames: 1 to 8 |
/// | 342 each | | see [`StageFrame`]; the newest is the last |
#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    /// Which leader.
    pub instance: u64,
    /// How many leaders took over before it.
    pub term: u32,
    /// Number of the newest frame.
    pub number: u64,
    /// When this was sent, nanoseconds of the leader's clock.
    pub sent_ns: i64,
    /// How long before their time frames are sent, milliseconds.
    pub lead_ms: u16,
    /// Which voice.
    pub voice: u8,
    /// The style of the voice.
    pub style: String,
    /// The frames, oldest first.
    pub frames: Vec<StageFrame>,
}

impl Frames {
    /// Each frame with its number, oldest first.
    pub fn numbered(&self) -> impl Iterator<Item = (u64, &StageFrame)> {
        let first = (self.number + 1).saturating_sub(self.frames.len() as u64);
        (first..).zip(&self.frames)
    }

    pub(super) fn write(&self, put: &mut Put) {
        put.u64(self.instance).u32(self.term).u64(self.number);
        put.i64(self.sent_ns).u16(self.lead_ms).u8(self.voice);
        put.name(&self.style).u8(self.frames.len() as u8);
        self.frames.iter().for_each(|frame| frame.write(put));
    }

    pub(super) fn read(take: &mut Take) -> Result<Self, WireError> {
        let mut message = Self {
            instance: take.u64()?,
            term: take.u32()?,
            number: take.u64()?,
            sent_ns: time(take)?,
            lead_ms: take.u16()?,
            voice: take.u8()?,
            style: take.name()?,
            frames: Vec::new(),
        };
        let count = usize::from(take.u8()?);
        if !(1..=MOST_FRAMES).contains(&count) {
            return Err(WireError::Value("the number of frames"));
        }
        if message.number >= u64::MAX / 2 || message.number + 1 < count as u64 {
            return Err(WireError::Value("the number of a frame"));
        }
        for _ in 0..count {
            message.frames.push(StageFrame::read(take)?);
        }
        Ok(message)
    }
}
