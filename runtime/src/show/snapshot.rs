//! The state of a show at one moment, as whoever watches may see it.
//!
//! Made so that the control loop can copy it without allocating, as long as
//! nothing happens that deserves a line of text. Radians, metres, seconds; robot axes x forward,
//! y left, z up. What is not known is NaN, and becomes `null` for viewers.

use super::request::Settings;
use servodance_drivers::State;
use servodance_types::{BeatLock, JOINT_COUNT};

/// Bands of the spectrum.
pub const BANDS: usize = 32;
/// Events of the safety layer that are kept in view.
pub const EVENTS: usize = 8;

/// What the program is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Activity {
    /// Torque is off until somebody says `start`.
    #[default]
    Waiting,
    /// Servos are being checked.
    Starting,
    /// Standing until live music comes.
    Listening,
    /// On the way to the first pose.
    Prelude,
    /// Dancing, or idling while there is no music.
    Dancing,
    /// On the way to rest.
    Finale,
    /// A recording is played back; nothing moves.
    Playing,
    /// Torque is off and the program ends.
    Over,
}

impl Activity {
    /// The word for it.
    pub const fn name(self) -> &'static str {
        match self {
            Activity::Waiting => "waiting",
            Activity::Starting => "starting",
            Activity::Listening => "listening",
            Activity::Prelude => "prelude",
            Activity::Dancing => "dancing",
            Activity::Finale => "finale",
            Activity::Playing => "playing",
            Activity::Over => "over",
        }
    }
}

/// One joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointNow {
    /// What the servo was told, inside the limits.
    pub target_rad: f64,
    /// What it reported.
    pub position_rad: f64,
    /// What it reported.
    pub velocity_rad_s: f64,
    /// What it reported.
    pub current_a: f64,
    /// When it was last asked.
    pub temperature_c: f64,
}

impl Default for JointNow {
    fn default() -> Self {
        Self {
            target_rad: 0.0,
            position_rad: 0.0,
            velocity_rad_s: 0.0,
            current_a: 0.0,
            temperature_c: f64::NAN,
        }
    }
}

/// What is heard at this moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MusicNow {
    /// Position between two beats, 0 to 1.
    pub phase: f64,
    /// Beats a minute; 0 while unknown.
    pub tempo_bpm: f64,
    /// How sure the beat is, 0 to 1.
    pub confidence: f64,
    /// Whether the beat is had.
    pub lock: BeatLock,
    /// How sure it is that this is music, 0 to 1.
    pub presence: f64,
    /// Level of each band, 0 to 1, low to high.
    pub bands: [f32; BANDS],
}

/// The bus so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)] // the names say it
pub struct BusNow {
    pub cycles: u64,
    pub timeouts: u64,
    pub crc_errors: u64,
    pub retries: u64,
}

/// A change of the safety layer's state, or a remark of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Event {
    /// Seconds since torque on.
    pub time_s: f64,
    /// The state after it.
    pub state: &'static str,
    /// Why.
    pub cause: String,
}

/// All of it that has a fixed size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// What the program is doing.
    pub activity: Activity,
    /// Seconds since torque on.
    pub robot_s: f64,
    /// Seconds of music; below zero before it.
    pub music_s: f64,
    /// `world_from_root`: x, y, z, then the quaternion x, y, z, w.
    pub root: [f64; 7],
    /// The 22 points of the human whom the robot follows, if there is one.
    pub human: Option<[[f32; 3]; JOINT_COUNT]>,
    /// What is heard.
    pub music: MusicNow,
    /// Share of idle in what is shown, 0 to 1.
    pub idle_share: f64,
    /// What was asked for.
    pub settings: Settings,
    /// The amplitude on its way to what was asked for.
    pub amplitude: f64,
    /// Whether somebody asked to hold (or to pause, where a recording plays).
    pub hold: bool,
    /// The bus.
    pub bus: BusNow,
    /// Control cycles a second, of late.
    pub rate_hz: f64,
    /// How late the latest of the last cycles was, milliseconds.
    pub late_ms: f64,
    /// Cycles without the motion that they needed.
    pub late_frames: u64,
    /// State of the safety layer.
    pub safety: State,
    /// Commands that the safety layer changed.
    pub interventions: u64,
    /// Limits broken at simulated servos; `None` on real ones.
    pub violations: Option<u64>,
}

/// All of it.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// What has a fixed size.
    pub now: Moment,
    /// The joints, in order.
    pub joints: Vec<JointNow>,
    events: Vec<Event>,
    /// How many events there were.
    events_seen: usize,
}

impl Snapshot {
    /// Before anything happened, of a robot with so many joints.
    pub fn new(joints: usize, settings: Settings) -> Self {
        let now = Moment {
            activity: Activity::default(),
            robot_s: 0.0,
            music_s: 0.0,
            root: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            human: None,
            music: MusicNow::default(),
            idle_share: 0.0,
            settings,
            amplitude: settings.amplitude,
            hold: false,
            bus: BusNow::default(),
            rate_hz: 0.0,
            late_ms: 0.0,
            late_frames: 0,
            safety: State::Disarmed,
            interventions: 0,
            violations: None,
        };
        Self {
            now,
            joints: vec![JointNow::default(); joints],
            events: Vec::with_capacity(EVENTS),
            events_seen: 0,
        }
    }

    /// Adds an event; the oldest goes.
    pub fn note(&mut self, event: Event) {
        if self.events.len() == EVENTS {
            self.events.remove(0);
        }
        self.events.push(event);
        self.events_seen += 1;
    }

    /// Other events take the place of those that were told.
    pub fn retell(&mut self, events: impl Iterator<Item = Event>) {
        self.events.clear();
        events.for_each(|event| self.note(event));
        self.events_seen += 1; // also if there are none
    }

    /// The newest events, oldest first.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Becomes the other; allocates only where there are new events.
    pub fn copy_from(&mut self, other: &Self) {
        self.now = other.now;
        self.joints.clone_from(&other.joints);
        if self.events_seen != other.events_seen {
            self.events.clone_from(&other.events);
            self.events_seen = other.events_seen;
        }
    }
}

/// The same word for a state, from a recording; unknown ones are "event".
pub fn known_state(word: &str) -> &'static str {
    let states = [
        State::Disarmed,
        State::Arming,
        State::Running,
        State::Holding,
        State::Stopping,
        State::Fault,
    ];
    let mut words = states.into_iter().map(state_name);
    words.find(|known| *known == word).unwrap_or("event")
}

/// The word for a state of the safety layer.
pub const fn state_name(state: State) -> &'static str {
    match state {
        State::Disarmed => "disarmed",
        State::Arming => "arming",
        State::Running => "running",
        State::Holding => "holding",
        State::Stopping => "stopping",
        State::Fault => "fault",
    }
}
