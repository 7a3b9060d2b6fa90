//! The state of robot and music at one moment, for viewers.
//!
//! The control loop copies a snapshot without allocating unless there are new
//! events. Radians, metres, seconds; robot axes x forward, y left, z up. Unknown
//! values are NaN, and `null` in JSON.

use crate::control::idle::IdleStyle;
use crate::pipeline::step_times::StepTimes;
use serde::{Serialize, Serializer};
use servodance_drivers::{BusStats, ServoErrors, State};
use servodance_types::{BeatLock, HeldBack, JOINT_COUNT, named};
use std::time::Instant;

pub const BANDS: usize = 32;
pub const EVENTS: usize = 8;

/// What the program is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)] // the names say it
pub enum Activity {
    /// Torque is off until somebody says `start`.
    #[default]
    Waiting,
    Starting,
    /// Standing until live music comes.
    Listening,
    Prelude,
    Dancing,
    Finale,
    Playing,
    Over,
}

named!(Activity {
    Waiting "waiting", Starting "starting", Listening "listening", Prelude "prelude",
    Dancing "dancing", Finale "finale", Playing "playing", Over "over",
});

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointStatus {
    pub target_rad: f64,
    pub position_rad: f64,
    pub velocity_rad_s: f64,
    pub current_a: f64,
    pub temperature_c: f64,
    /// Why it does not go where the dance would have it.
    pub held: HeldBack,
    /// What went wrong with its servo on the wire since the dance began.
    pub errors: ServoErrors,
}

impl Default for JointStatus {
    fn default() -> Self {
        Self {
            target_rad: 0.0,
            position_rad: 0.0,
            velocity_rad_s: 0.0,
            current_a: 0.0,
            temperature_c: f64::NAN,
            held: HeldBack::Nothing,
            errors: ServoErrors::default(),
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MusicStatus {
    #[serde(serialize_with = "rounded")]
    pub phase: f64,
    #[serde(serialize_with = "rounded")]
    pub tempo_bpm: f64,
    #[serde(serialize_with = "rounded")]
    pub confidence: f64,
    #[serde(serialize_with = "lock_name")]
    pub lock: BeatLock,
    #[serde(serialize_with = "rounded")]
    pub presence: f64,
    /// Place of the last beat in its bar from 1, and the beats of a bar; `None` while no
    /// bar stands out.
    pub place: Option<u8>,
    pub meter: Option<u8>,
    /// How sure of both, 0 to 1.
    #[serde(serialize_with = "rounded")]
    pub bar_confidence: f64,
    #[serde(skip)]
    pub bands: [f32; BANDS],
}

/// A change of the safety layer's state, or a remark of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ViewerEvent {
    #[serde(serialize_with = "rounded")]
    pub time_s: f64,
    pub state: &'static str,
    pub cause: String,
}

/// What a viewer can change while the robot dances.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)] // the names say it
pub struct ViewerSettings {
    pub amplitude: f64,
    pub mirror: bool,
    pub idle: IdleStyle,
    pub style: usize,
    pub seed: u64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotStatus {
    /// When viewers were told this.
    pub published: Instant,
    pub activity: Activity,
    /// Seconds since torque on.
    pub robot_s: f64,
    pub music_s: f64,
    /// `world_from_root`: x, y, z, then the quaternion x, y, z, w.
    pub root: [f64; 7],
    /// The 22 points of the human whom the robot follows, if there is one.
    pub human: Option<[[f32; 3]; JOINT_COUNT]>,
    pub music: MusicStatus,
    pub idle_share: f64,
    pub settings: ViewerSettings,
    /// The amplitude on its way to what was asked for.
    pub amplitude: f64,
    /// Whether somebody asked to hold (or to pause, where a recording plays).
    pub hold: bool,
    pub bus: BusStats,
    /// Control cycles a second, of late.
    pub rate_hz: f64,
    /// How late the latest of the last cycles was, milliseconds.
    pub late_ms: f64,
    /// From one command to the next, in the last second.
    pub gaps: StepTimes,
    pub late_frames: u64,
    pub safety: State,
    /// The emergency stop is pressed and every torque was verified to be off since: how often
    /// the button had been released before. Written by the thread that drives the servos.
    pub stopped: Option<u64>,
    pub interventions: u64,
    /// Limits broken at simulated servos; `None` on real ones.
    pub violations: Option<u64>,
}

#[derive(Clone, Debug)]
pub struct Snapshot {
    pub now: RobotStatus,
    pub joints: Vec<JointStatus>,
    events: Vec<ViewerEvent>,
    events_seen: usize,
}

impl Snapshot {
    pub fn new(joints: usize, settings: ViewerSettings) -> Self {
        let now = RobotStatus {
            published: Instant::now(),
            activity: Activity::default(),
            robot_s: 0.0,
            music_s: 0.0,
            root: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            human: None,
            music: MusicStatus::default(),
            idle_share: 0.0,
            settings,
            amplitude: settings.amplitude,
            hold: false,
            bus: BusStats::default(),
            rate_hz: 0.0,
            late_ms: 0.0,
            gaps: StepTimes::default(),
            late_frames: 0,
            safety: State::Disarmed,
            stopped: None,
            interventions: 0,
            violations: None,
        };
        Self {
            now,
            joints: vec![JointStatus::default(); joints],
            events: Vec::with_capacity(EVENTS),
            events_seen: 0,
        }
    }

    /// Adds an event; drops the oldest beyond [`EVENTS`].
    pub fn push_event(&mut self, event: ViewerEvent) {
        if self.events.len() == EVENTS {
            self.events.remove(0);
        }
        self.events.push(event);
        self.events_seen += 1;
    }

    pub fn replace_events(&mut self, events: impl Iterator<Item = ViewerEvent>) {
        self.events.clear();
        events.for_each(|event| self.push_event(event));
        self.events_seen += 1; // also if there are none
    }

    pub fn events(&self) -> &[ViewerEvent] {
        &self.events
    }

    /// Copies the other; allocates only if there are new events.
    pub fn copy_from(&mut self, other: &Self) {
        self.now = other.now;
        self.joints.clone_from(&other.joints);
        if self.events_seen != other.events_seen {
            self.events.clone_from(&other.events);
            self.events_seen = other.events_seen;
        }
    }
}

const STATES: [(State, &str); 6] = [
    (State::Disarmed, "disarmed"),
    (State::Arming, "arming"),
    (State::Running, "running"),
    (State::Holding, "holding"),
    (State::Stopping, "stopping"),
    (State::Fault, "fault"),
];

/// A state's name as it stands in a recording; unknown ones are "event".
pub fn known_state(word: &str) -> &'static str {
    let known = STATES.iter().find(|(_, name)| *name == word);
    known.map_or("event", |(_, name)| name)
}

/// A number with four decimals; `null` if it is none.
pub fn rounded<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    match value.is_finite() {
        true => serializer.serialize_f64((value * 1e4).round() / 1e4),
        false => serializer.serialize_none(),
    }
}

fn lock_name<S: Serializer>(lock: &BeatLock, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(match lock {
        BeatLock::Lost => "lost",
        BeatLock::Locked => "locked",
        BeatLock::Holding => "holding",
        BeatLock::Changing => "changing",
    })
}

pub fn state_name(state: State) -> &'static str {
    let known = STATES.iter().find(|(of, _)| *of == state);
    known.map_or("", |(_, name)| name)
}
