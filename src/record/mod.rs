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
//! | `/robot_description` | String | the URDF |
//!
//! Time stamps count from torque on; the metadata record `dance` says when the
//! music began (`music_start_s`), and gives the joints' limits and the other
//! figures that a reader needs to check the report.

mod cdr;
mod schema;

use crate::output::PendingFile;
use crate::stages::Stage;
use anyhow::Context;
use cdr::CdrWriter;
use mcap::records::MessageHeader;
use schema::MessageType;
use servodance_types::{JointState, MotionFrame};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

const JOINT_FRAME: &str = "base_link";
const MOTION_FRAME: &str = "stage";

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
            Topic::RobotDescription => "/robot_description".into(),
            Topic::Stage(stage) => format!("/stage/{}", stage.name()),
        }
    }

    const fn message_type(self) -> MessageType {
        match self {
            Topic::Motion => MessageType::PoseArray,
            Topic::JointTargets | Topic::JointCommands | Topic::JointStates | Topic::ServoTruth => {
                MessageType::JointState
            }
            Topic::RobotDescription => MessageType::Text,
            _ => MessageType::Float64,
        }
    }
}

/// Writes a recording; without [`Recorder::finish`] no file appears.
pub struct Recorder {
    pending: PendingFile,
    writer: mcap::Writer<BufWriter<File>>,
    channels: BTreeMap<String, (u16, u32)>,
    joint_names: Vec<String>,
}

impl Recorder {
    /// Starts a recording of joints with these names.
    pub fn create(path: &Path, joint_names: Vec<String>) -> anyhow::Result<Self> {
        let pending = PendingFile::create(path)?;
        let writer = mcap::WriteOptions::new()
            .profile("ros2")
            .library(concat!("servodance ", env!("CARGO_PKG_VERSION")))
            .compression(None)
            .create(pending.writer()?)
            .with_context(|| format!("cannot record to {}", path.display()))?;
        Ok(Self {
            pending,
            writer,
            channels: BTreeMap::new(),
            joint_names,
        })
    }

    /// One number at `time_s`.
    pub fn number(&mut self, topic: Topic, time_s: f64, value: f64) -> anyhow::Result<()> {
        self.message(topic, time_s, &CdrWriter::new().f64(value).finish())
    }

    /// One text at `time_s`.
    pub fn text(&mut self, topic: Topic, time_s: f64, value: &str) -> anyhow::Result<()> {
        self.message(topic, time_s, &CdrWriter::new().string(value).finish())
    }

    /// Joint positions alone, radians.
    pub fn positions(
        &mut self,
        topic: Topic,
        time_s: f64,
        positions_rad: &[f64],
    ) -> anyhow::Result<()> {
        let mut cdr = self.joint_header(time_s);
        cdr.f64s(positions_rad.iter().copied()).u32(0).u32(0);
        self.message(topic, time_s, &cdr.finish())
    }

    /// Whole joint states: radians, radians a second, amperes.
    pub fn states(
        &mut self,
        topic: Topic,
        time_s: f64,
        states: &[JointState],
    ) -> anyhow::Result<()> {
        let mut cdr = self.joint_header(time_s);
        cdr.f64s(states.iter().map(|s| s.position_rad))
            .f64s(states.iter().map(|s| s.velocity_rad_s))
            .f64s(states.iter().map(|s| s.current_a));
        self.message(topic, time_s, &cdr.finish())
    }

    /// A human motion frame at `time_s`, turned from y up to z up, facing x.
    pub fn motion(&mut self, time_s: f64, frame: &MotionFrame) -> anyhow::Result<()> {
        let mut cdr = CdrWriter::new();
        cdr.header(time_s, MOTION_FRAME);
        cdr.u32(frame.positions.len() as u32);
        for [left, up, forward] in frame.positions {
            for value in [forward, left, up] {
                cdr.f64(value.into());
            }
            for value in [0.0, 0.0, 0.0, 1.0] {
                cdr.f64(value);
            }
        }
        self.message(Topic::Motion, time_s, &cdr.finish())
    }

    /// Facts about the run, as text by key.
    pub fn metadata(&mut self, facts: BTreeMap<String, String>) -> anyhow::Result<()> {
        self.writer.write_metadata(&mcap::records::Metadata {
            name: "dance".into(),
            metadata: facts,
        })?;
        Ok(())
    }

    /// Closes the recording and gives the file its name.
    pub fn finish(mut self) -> anyhow::Result<()> {
        self.writer.finish()?;
        self.writer.into_inner().flush()?;
        self.pending.finish()
    }

    fn joint_header(&self, time_s: f64) -> CdrWriter {
        let mut cdr = CdrWriter::new();
        cdr.header(time_s, JOINT_FRAME);
        cdr.u32(self.joint_names.len() as u32);
        for name in &self.joint_names {
            cdr.string(name);
        }
        cdr
    }

    fn message(&mut self, topic: Topic, time_s: f64, data: &[u8]) -> anyhow::Result<()> {
        let (channel_id, sequence) = self.channel(topic)?;
        let log_time = (time_s.max(0.0) * 1e9).round() as u64;
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time,
            publish_time: log_time,
        };
        self.writer.write_to_known_channel(&header, data)?;
        Ok(())
    }

    fn channel(&mut self, topic: Topic) -> anyhow::Result<(u16, u32)> {
        let name = topic.name();
        if let Some((id, sequence)) = self.channels.get_mut(&name) {
            *sequence += 1;
            return Ok((*id, *sequence));
        }
        let kind = topic.message_type();
        let schema =
            self.writer
                .add_schema(kind.name(), "ros2msg", kind.definition().as_bytes())?;
        let id = self
            .writer
            .add_channel(schema, &name, "cdr", &BTreeMap::new())?;
        self.channels.insert(name, (id, 0));
        Ok((id, 0))
    }
}
