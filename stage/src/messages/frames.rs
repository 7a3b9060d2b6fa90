//! Motion frames: the newest of a channel and the few before it.

use super::codec::{ByteReader, Field};
use super::error::MessageError;
use servodance_types::{Beat, BeatLock, Contacts, JOINT_COUNT, MotionFrame, MusicFrame, Posture};

/// Largest number of frames in one message.
pub(crate) const MAX_FRAMES: usize = 8;
/// Largest coordinate of a joint, metres.
const FARTHEST_M: f32 = 1000.0;
/// Largest value of a posture: radians, leg lengths.
const WIDEST: f32 = 100.0;
/// Largest level either way, in units of 20 dB.
const LOUDEST: f32 = 1000.0;
/// Largest tempo, beats a minute.
const FASTEST_BPM: f32 = 1000.0;
/// Index of the level in the music features.
const LEVEL: usize = 1;

/// One motion frame with the music that it was made for.
///
/// | bytes | type | value |
/// | ---: | --- | :--- |
/// | 8 | i64 | presentation time at the servos, nanoseconds of the leader's clock |
/// | 8 | i64 | time in the music, nanoseconds |
/// | 4 | f32 | beat phase, 0 (on the beat) to 1 |
/// | 4 | f32 | tempo, beats a minute; 0 while unknown |
/// | 4 | f32 | confidence of the beat, 0 to 1 |
/// | 4 | f32 | presence of music, 0 to 1 |
/// | 4 | f32 | level, in units of 20 dB as in the music features |
/// | 1 | u8 | beat: 0 lost, 1 locked, 2 holding |
/// | 1 | u8 | feet on the floor: bit 0 left, bit 1 right |
/// | 264 | 66 f32 | x, y (up), z of the 22 joints, metres |
/// | 40 | 10 f32 | baseline posture: heading, nod (2), sway (2), left foot (2), right foot (2), floor |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageFrame {
    /// Presentation time at the servos, nanoseconds of the leader's clock.
    pub present_ns: i64,
    /// Time in the music, nanoseconds.
    pub music_ns: i64,
    /// The beat at that time.
    pub beat: Beat,
    /// Probability of music, 0 to 1.
    pub presence: f32,
    /// Level of the sound in units of 20 dB.
    pub level: f32,
    /// Contact of the feet with the floor.
    pub contacts: Contacts,
    /// Joint positions in the world, metres.
    pub positions: [[f32; 3]; JOINT_COUNT],
    /// Baseline posture, against which all followers measure movement.
    pub posture: Posture,
}

impl StageFrame {
    /// The frame that the servos show at `present_ns`.
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

    /// The motion, at `time_s` of the caller's time.
    pub fn motion(&self, time_s: f64) -> MotionFrame {
        MotionFrame { time_s, positions: self.positions, contacts: self.contacts }
    }

    /// The music features that a frame carries, at `time_s` of the caller's time.
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
}

impl Field for StageFrame {
    fn write(&self, out: &mut Vec<u8>) {
        let (beat, posture) = (self.beat, self.posture);
        self.present_ns.write(out);
        self.music_ns.write(out);
        let music = [beat.phase, beat.tempo_bpm, beat.confidence, self.presence, self.level];
        let lock = match beat.lock {
            BeatLock::Lost => 0,
            // A follower needs no warning: it dances what the leader sends.
            BeatLock::Locked | BeatLock::Changing => 1,
            BeatLock::Holding => 2,
        };
        let feet = u8::from(self.contacts.left) | u8::from(self.contacts.right) << 1;
        music.iter().for_each(|value| value.write(out));
        out.extend([lock, feet]);
        let [left, right] = posture.feet;
        let pairs = [posture.nod_rad, posture.sway, left, right];
        let positions = self.positions.as_flattened().iter();
        let values = positions.chain([&posture.heading_rad]).chain(pairs.as_flattened());
        values.chain([&posture.floor_m]).for_each(|value| value.write(out));
    }

    fn read(input: &mut ByteReader) -> Result<Self, MessageError> {
        let (present_ns, music_ns) = (input.get()?, input.get()?);
        let mut beat = Beat {
            phase: input.within(1.0, "the phase of a beat")?,
            tempo_bpm: input.within(FASTEST_BPM, "a tempo")?,
            confidence: input.within(1.0, "the confidence of a beat")?,
            ..Beat::default()
        };
        let presence = input.within(1.0, "the presence of music")?;
        let level = input.within(LOUDEST, "a level")?;
        beat.lock = match input.get::<u8>()? {
            0 => BeatLock::Lost,
            1 => BeatLock::Locked,
            2 => BeatLock::Holding,
            _ => return Err(MessageError::Value("the state of a beat")),
        };
        let feet: u8 = input.get()?;
        if feet > 3 {
            return Err(MessageError::Value("feet on the floor"));
        }
        let mut positions = [[0.0; 3]; JOINT_COUNT];
        for value in positions.as_flattened_mut() {
            *value = input.within(FARTHEST_M, "a joint")?;
        }
        let heading_rad = input.within(WIDEST, "a heading")?;
        let mut pairs = [[0.0; 2]; 4];
        for value in pairs.as_flattened_mut() {
            *value = input.within(WIDEST, "a posture")?;
        }
        let [nod_rad, sway, left, right] = pairs;
        Ok(Self {
            present_ns,
            music_ns,
            beat,
            presence,
            level,
            contacts: Contacts { left: feet & 1 > 0, right: feet & 2 > 0 },
            positions,
            posture: Posture {
                heading_rad,
                nod_rad,
                sway,
                feet: [left, right],
                floor_m: input.within(FARTHEST_M, "a floor")?,
            },
        })
    }
}

/// The newest frame of a channel and the few before it, so that the loss of one
/// message loses no frame. The bytes are those of the fields, in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    /// Random number that the leader drew when it started.
    pub instance: u64,
    /// Number of leaders that led before this one.
    pub term: u32,
    /// Number of the newest frame; one more for each.
    pub number: u64,
    /// Departure of this message, nanoseconds of the leader's clock.
    pub sent_ns: i64,
    /// How long before their time frames are sent, milliseconds.
    pub lead_ms: u16,
    /// Channel: 0 the stage's own style, others for followers that want another.
    pub channel: u8,
    /// Name of the style of the channel.
    pub style: String,
    /// 1 to 8 frames of 342 bytes, the newest last; their number in one byte before.
    pub frames: Vec<StageFrame>,
}

impl Frames {
    /// Each frame with its number, oldest first.
    pub fn numbered(&self) -> impl Iterator<Item = (u64, &StageFrame)> {
        let first = (self.number + 1).saturating_sub(self.frames.len() as u64);
        (first..).zip(&self.frames)
    }
}

impl Field for Frames {
    fn write(&self, out: &mut Vec<u8>) {
        self.instance.write(out);
        self.term.write(out);
        self.number.write(out);
        self.sent_ns.write(out);
        self.lead_ms.write(out);
        self.channel.write(out);
        self.style.write(out);
        (self.frames.len() as u8).write(out);
        self.frames.iter().for_each(|frame| frame.write(out));
    }

    fn read(input: &mut ByteReader) -> Result<Self, MessageError> {
        let mut message = Self {
            instance: input.get()?,
            term: input.get()?,
            number: input.get()?,
            sent_ns: input.get()?,
            lead_ms: input.get()?,
            channel: input.get()?,
            style: input.get()?,
            frames: Vec::new(),
        };
        let count = usize::from(input.get::<u8>()?);
        if !(1..=MAX_FRAMES).contains(&count) {
            return Err(MessageError::Value("the number of frames"));
        }
        if message.number >= u64::MAX / 2 || message.number + 1 < count as u64 {
            return Err(MessageError::Value("the number of a frame"));
        }
        for _ in 0..count {
            message.frames.push(input.get()?);
        }
        Ok(message)
    }
}
