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
//! | `/tf`, `/tf_static` | TFMessage | each link in its parent's frame, 20 a second; what is fixed |
//! | `/human`, `/beat_marker` | Marker | the human as lines; a ball at each beat |
//! | `/audio` | RawAudio | the song, 16 bit, 20 pieces a second; nothing of live music |
//! | `/spectrum` | Float32MultiArray | 32 bands, 0 to 1, 20 a second |
//! | `/temperatures` | Temperature | Celsius of the joint in `frame_id`, when it changes |
//! | `/safety` | Log | what the safety layer did: `safety.STATE`, and why |
//! | `/robot_description` | String | the URDF |
//!
//! Time stamps count from torque on; the metadata record `dance` says when the
//! music began (`music_start_s`), and gives the joints' limits and the other
//! figures that a reader needs to check the report, and how many messages were
//! left out because the disk was too slow (`messages_left_out`).

mod link_frames;
mod marker;
mod mcap_file;
mod message_types;
mod recording;
mod topic;
mod writer_thread;

pub use recording::{RecordedAudio, RecordedEvent, Recording, Series};

use crate::telemetry::pose_array::pose_from_array;
use link_frames::{LinkFrames, MOTION_FRAME, WORLD_FRAME};
use servodance_retarget::RobotModel;
use servodance_stage::ros2::{CdrWriter, joint_state, pose_array};
use servodance_types::{JointState, MotionFrame};
use std::collections::BTreeMap;
use std::path::Path;
pub use topic::RecordingTopic;
use topic::SAFETY;
use writer_thread::WriterThread;
pub use writer_thread::{OnRecordingError, WhenBehind};

/// Foxglove's name for 16-bit samples, little-endian.
const AUDIO_FORMAT: &str = "pcm-s16";
const LOG_INFO: u8 = 20;
const LOG_ERROR: u8 = 40;

#[derive(Clone, Copy, Debug)]
pub(crate) struct SafetyNotice<'a> {
    pub time_s: f64,
    pub grave: bool,
    pub state: &'a str,
    pub cause: &'a str,
}

/// Turns what happens into messages and has a writer write them; without
/// [`Recorder::finish`] no file appears. Nothing here waits for a disk, unless
/// [`WhenBehind::Wait`] says so; `finish` returns what went wrong.
pub struct Recorder {
    writer: WriterThread,
    joint_names: Vec<String>,
    /// Known from the first pose on.
    link_frames: Option<LinkFrames>,
}

impl Recorder {
    /// Starts a recording of joints with these names.
    pub fn create(
        path: &Path,
        joint_names: Vec<String>,
        when_behind: WhenBehind,
        on_error: OnRecordingError,
    ) -> anyhow::Result<Self> {
        let writer = WriterThread::start(path, when_behind, on_error)?;
        Ok(Self { writer, joint_names, link_frames: None })
    }

    /// One number at `time_s`.
    pub fn number(&mut self, topic: RecordingTopic, time_s: f64, value: f64) {
        self.writer.message(topic, time_s, CdrWriter::new().f64(value).finish());
    }

    /// One text at `time_s`.
    pub fn text(&mut self, topic: RecordingTopic, time_s: f64, value: &str) {
        self.writer.message(topic, time_s, CdrWriter::new().string(value).finish());
    }

    /// Joint positions alone, radians.
    pub fn positions(&mut self, topic: RecordingTopic, time_s: f64, positions_rad: &[f64]) {
        let mut cdr = self.joint_header(time_s);
        cdr.f64s(positions_rad.iter().copied()).u32(0).u32(0);
        self.writer.message(topic, time_s, cdr.finish());
    }

    /// Whole joint states: radians, radians a second, amperes.
    pub fn states(&mut self, topic: RecordingTopic, time_s: f64, states: &[JointState]) {
        let mut cdr = self.joint_header(time_s);
        cdr.f64s(states.iter().map(|s| s.position_rad))
            .f64s(states.iter().map(|s| s.velocity_rad_s))
            .f64s(states.iter().map(|s| s.current_a));
        self.writer.message(topic, time_s, cdr.finish());
    }

    /// A human motion frame at `time_s`, turned from y up to z up, facing x.
    pub fn motion(&mut self, time_s: f64, frame: &MotionFrame) {
        let points =
            frame.positions.iter().map(|[left, up, forward]| [*forward, *left, *up].map(f64::from));
        let message = pose_array(time_s, MOTION_FRAME, points);
        self.writer.message(RecordingTopic::Motion, time_s, message);
        self.writer.message(RecordingTopic::Human, time_s, marker::human(time_s, frame));
    }

    /// A pose in the world: x, y, z, then the quaternion x, y, z, w.
    pub fn pose(&mut self, topic: RecordingTopic, time_s: f64, pose: [f64; 7]) {
        let mut cdr = CdrWriter::new();
        cdr.header(time_s, WORLD_FRAME);
        for value in pose {
            cdr.f64(value);
        }
        self.writer.message(topic, time_s, cdr.finish());
    }

    /// Where the links are: the root in the world (as [`Recorder::pose`] has it), joints in
    /// radians.
    pub fn links(&mut self, time_s: f64, model: &RobotModel, root: [f64; 7], joints: &[f64]) {
        let poses = model.link_poses(joints);
        if self.link_frames.is_none() {
            let frames = LinkFrames::new(model, joints.len());
            let fixed = frames.fixed(time_s, &poses);
            self.writer.message(RecordingTopic::FixedTransforms, time_s, fixed);
            self.link_frames = Some(frames);
        }
        if let Some(frames) = &self.link_frames {
            let moving = frames.moving(time_s, &pose_from_array(root), &poses);
            self.writer.message(RecordingTopic::Transforms, time_s, moving);
        }
    }

    /// A beat of the music, at this tempo.
    pub fn beat(&mut self, time_s: f64, tempo_bpm: f64) {
        self.number(RecordingTopic::Beat, time_s, tempo_bpm);
        self.writer.message(RecordingTopic::BeatMarker, time_s, marker::beat(time_s));
    }

    pub(crate) fn spectrum(&mut self, time_s: f64, bands: &[f32]) {
        let count = bands.len() as u32;
        let mut cdr = CdrWriter::new();
        cdr.u32(1).string("band").u32(count).u32(count).u32(0);
        let data = cdr.f32s(bands.iter().copied()).finish();
        self.writer.message(RecordingTopic::Spectrum, time_s, data);
    }

    /// A piece of the song: mono, 16 bit.
    pub(crate) fn audio(&mut self, time_s: f64, samples: &[i16], rate_hz: u32) {
        let bytes: Vec<u8> = samples.iter().flat_map(|sample| sample.to_le_bytes()).collect();
        let mut cdr = CdrWriter::new();
        let data = cdr.time(time_s).bytes(&bytes).string(AUDIO_FORMAT).u32(rate_hz).u32(1).finish();
        self.writer.message(RecordingTopic::Audio, time_s, data);
    }

    /// How warm the servo of a joint is, Celsius; NaN where it does not say.
    pub fn temperature(&mut self, joint: usize, time_s: f64, celsius: f64) {
        let name = self.joint_names.get(joint).map_or("", String::as_str);
        let mut cdr = CdrWriter::new();
        let data = cdr.header(time_s, name).f64(celsius).f64(0.0).finish();
        self.writer.message(RecordingTopic::Temperatures, time_s, data);
    }

    pub(crate) fn notice(&mut self, notice: SafetyNotice) {
        let name = format!("{SAFETY}.{}", notice.state);
        let mut cdr = CdrWriter::new();
        cdr.time(notice.time_s)
            .u8(if notice.grave { LOG_ERROR } else { LOG_INFO })
            .string(&name)
            .string(notice.cause);
        let data = cdr.string("").string("").u32(0).finish();
        self.writer.message(RecordingTopic::Safety, notice.time_s, data);
    }

    /// Facts about the run, as text by key.
    pub fn metadata(&mut self, facts: BTreeMap<String, String>) {
        self.writer.facts(facts);
    }

    /// Closes the recording and gives the file its name.
    /// The error is what went wrong since the beginning.
    pub fn finish(self) -> anyhow::Result<()> {
        self.writer.finish()
    }

    fn joint_header(&self, time_s: f64) -> CdrWriter {
        let names = self.joint_names.iter().map(String::as_str);
        joint_state(time_s, WORLD_FRAME, names)
    }
}
