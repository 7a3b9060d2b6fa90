//! The recording of a dance: an MCAP file with ROS 2 message types, so that
//! the usual robotics viewers open it.
//!
//! | topic | type | what |
//! |---|---|---|
//! | `/motion` | PoseArray | the 22 human joints, z up, 20 a second |
//! | `/joint_targets` | JointState | what the retargeter asked for |
//! | `/joint_commands` | JointState | what the safety layer let pass |
//! | `/joint_states` | JointState | what the servos reported (effort: amperes) |
//! | `/servo_truth` | JointState | where the simulated servos truly were |
//! | `/beat` | Float64 | the tempo, at each beat of the music |
//! | `/beat_phase` | Float64 | the phase that the generator heard, 20 a second |
//! | `/stage/NAME` | Float64 | milliseconds that the stage took |
//! | `/lead` | Float64 | seconds by which the targets' motion is ahead of the music |
//! | `/idle` | Float64 | share of idle in what is shown: 0 dance, 1 idle |
//! | `/bus/bytes`, `/bus/packets` | Float64 | running totals |
//! | `/root` | PoseStamped | where the root link is in the world, 20 a second |
//! | `/spectrum` | Float32MultiArray | 32 bands, 0 to 1, 20 a second |
//! | `/temperatures` | Temperature | Celsius of the joint in `frame_id`, when it changes |
//! | `/safety` | Log | what the safety layer did: `safety.STATE`, and why |
//! | `/robot_description` | String | the URDF |
//!
//! Time stamps count from torque on; the metadata record `dance` says when the
//! music began (`music_start_s`), and gives the joints' limits and the other
//! figures that a reader needs to check the report, and how many messages were
//! left out because the disk was too slow (`messages_left_out`).

mod book;
mod clerk;
mod reader;
mod schema;

pub use reader::{Past, Recording, Series};

use crate::stages::Stage;
use clerk::Clerk;
pub use clerk::{OnTrouble, WhenBehind};
use schema::MessageType;
use servodance_stage::ros2::{CdrWriter, joint_state, pose_array};
use servodance_types::{JointState, MotionFrame};
use std::collections::BTreeMap;
use std::path::Path;

const JOINT_FRAME: &str = "base_link";
const MOTION_FRAME: &str = "stage";
const WORLD_FRAME: &str = "world";

/// In front of the state in the names of log messages.
pub(crate) const SAFETY: &str = "safety";
/// Levels of rcl_interfaces/Log.
const LOG_INFO: u8 = 20;
const LOG_ERROR: u8 = 40;

/// Something that the safety layer did.
#[derive(Clone, Copy, Debug)]
pub struct Notice<'a> {
    /// Seconds since torque on.
    pub time_s: f64,
    /// Whether it is a fault.
    pub grave: bool,
    /// The state after it.
    pub state: &'a str,
    /// Why.
    pub cause: &'a str,
}

/// A topic of the recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    /// Human motion.
    Motion,
    /// What the retargeter asked for.
    JointTargets,
    /// What the safety layer let pass.
    JointCommands,
    /// What the servos reported.
    JointStates,
    /// Where the simulated servos truly were.
    ServoTruth,
    /// Beats of the music.
    Beat,
    /// The phase that the generator heard.
    BeatPhase,
    /// Seconds by which the targets' motion is ahead of the music.
    Lead,
    /// Share of idle in what is shown.
    Idle,
    /// Bytes on the wire so far.
    BusBytes,
    /// Packets on the wire so far.
    BusPackets,
    /// Where the root link is.
    Root,
    /// What is heard.
    Spectrum,
    /// How warm servos are.
    Temperatures,
    /// What the safety layer did.
    Safety,
    /// The URDF.
    RobotDescription,
    /// Milliseconds of one stage.
    Stage(Stage),
}

impl Topic {
    fn name(self) -> String {
        match self {
            Topic::Motion => "/motion".into(),
            Topic::JointTargets => "/joint_targets".into(),
            Topic::JointCommands => "/joint_commands".into(),
            Topic::JointStates => "/joint_states".into(),
            Topic::ServoTruth => "/servo_truth".into(),
            Topic::Beat => "/beat".into(),
            Topic::BeatPhase => "/beat_phase".into(),
            Topic::Lead => "/lead".into(),
            Topic::Idle => "/idle".into(),
            Topic::BusBytes => "/bus/bytes".into(),
            Topic::BusPackets => "/bus/packets".into(),
            Topic::Root => "/root".into(),
            Topic::RobotDescription => "/robot_description".into(),
            Topic::Spectrum => "/spectrum".into(),
            Topic::Temperatures => "/temperatures".into(),
            Topic::Safety => "/safety".into(),
            Topic::Stage(stage) => format!("/stage/{}", stage.name()),
        }
    }

    const fn message_type(self) -> MessageType {
        match self {
            Topic::Motion => MessageType::PoseArray,
            Topic::JointTargets | Topic::JointCommands | Topic::JointStates | Topic::ServoTruth => {
                MessageType::JointState
            }
            Topic::Root => MessageType::PoseStamped,
            Topic::Spectrum => MessageType::FloatArray,
            Topic::Temperatures => MessageType::Temperature,
            Topic::Safety => MessageType::Log,
            Topic::RobotDescription => MessageType::Text,
            _ => MessageType::Float64,
        }
    }
}

/// Turns what happens into messages and has a clerk write them; without
/// [`Recorder::finish`] no file appears. Nothing here waits for a disk, unless
/// [`WhenBehind::Wait`] says so; what went wrong with it is told by `finish`.
pub struct Recorder {
    clerk: Clerk,
    joint_names: Vec<String>,
}

impl Recorder {
    /// Starts a recording of joints with these names.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(
        path: &Path,
        joint_names: Vec<String>,
        when_behind: WhenBehind,
        on_trouble: OnTrouble,
    ) -> anyhow::Result<Self> {
        let clerk = Clerk::start(path, when_behind, on_trouble)?;
        Ok(Self { clerk, joint_names })
    }

    /// One number at `time_s`.
    pub fn number(&mut self, topic: Topic, time_s: f64, value: f64) {
        self.clerk
            .message(topic, time_s, CdrWriter::new().f64(value).finish());
    }

    /// One text at `time_s`.
    pub fn text(&mut self, topic: Topic, time_s: f64, value: &str) {
        self.clerk
            .message(topic, time_s, CdrWriter::new().string(value).finish());
    }

    /// Joint positions alone, radians.
    pub fn positions(&mut self, topic: Topic, time_s: f64, positions_rad: &[f64]) {
        let mut cdr = self.joint_header(time_s);
        cdr.f64s(positions_rad.iter().copied()).u32(0).u32(0);
        self.clerk.message(topic, time_s, cdr.finish());
    }

    /// Whole joint states: radians, radians a second, amperes.
    pub fn states(&mut self, topic: Topic, time_s: f64, states: &[JointState]) {
        let mut cdr = self.joint_header(time_s);
        cdr.f64s(states.iter().map(|s| s.position_rad))
            .f64s(states.iter().map(|s| s.velocity_rad_s))
            .f64s(states.iter().map(|s| s.current_a));
        self.clerk.message(topic, time_s, cdr.finish());
    }

    /// A human motion frame at `time_s`, turned from y up to z up, facing x.
    pub fn motion(&mut self, time_s: f64, frame: &MotionFrame) {
        let points = frame
            .positions
            .iter()
            .map(|[left, up, forward]| [*forward, *left, *up].map(f64::from));
        let message = pose_array(time_s, MOTION_FRAME, points);
        self.clerk.message(Topic::Motion, time_s, message);
    }

    /// A pose in the world: x, y, z, then the quaternion x, y, z, w.
    pub fn pose(&mut self, topic: Topic, time_s: f64, pose: [f64; 7]) {
        let mut cdr = CdrWriter::new();
        cdr.header(time_s, WORLD_FRAME);
        for value in pose {
            cdr.f64(value);
        }
        self.clerk.message(topic, time_s, cdr.finish());
    }

    /// Levels of the bands of the spectrum, 0 to 1.
    pub fn spectrum(&mut self, time_s: f64, bands: &[f32]) {
        let count = bands.len() as u32;
        let mut cdr = CdrWriter::new();
        cdr.u32(1).string("band").u32(count).u32(count).u32(0);
        let data = cdr.f32s(bands.iter().copied()).finish();
        self.clerk.message(Topic::Spectrum, time_s, data);
    }

    /// How warm the servo of a joint is, Celsius; NaN where it does not say.
    pub fn temperature(&mut self, joint: usize, time_s: f64, celsius: f64) {
        let name = self.joint_names.get(joint).map_or("", String::as_str);
        let mut cdr = CdrWriter::new();
        let data = cdr.header(time_s, name).f64(celsius).f64(0.0).finish();
        self.clerk.message(Topic::Temperatures, time_s, data);
    }

    /// What the safety layer did.
    pub fn notice(&mut self, notice: Notice) {
        let name = format!("{SAFETY}.{}", notice.state);
        let mut cdr = CdrWriter::new();
        cdr.time(notice.time_s)
            .u8(if notice.grave { LOG_ERROR } else { LOG_INFO })
            .string(&name)
            .string(notice.cause);
        let data = cdr.string("").string("").u32(0).finish();
        self.clerk.message(Topic::Safety, notice.time_s, data);
    }

    /// Facts about the run, as text by key.
    pub fn metadata(&mut self, facts: BTreeMap<String, String>) {
        self.clerk.facts(facts);
    }

    /// Closes the recording and gives the file its name.
    ///
    /// # Errors
    /// What went wrong since the beginning, if anything did.
    pub fn finish(self) -> anyhow::Result<()> {
        self.clerk.finish()
    }

    fn joint_header(&self, time_s: f64) -> CdrWriter {
        let names = self.joint_names.iter().map(String::as_str);
        joint_state(time_s, JOINT_FRAME, names)
    }
}
