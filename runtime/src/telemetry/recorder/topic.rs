//! The topics of a recording: the name and the message type of each.

use super::message_types::{
    AUDIO, FLOAT_ARRAY, FLOAT64, JOINT_STATE, LOG, MARKER, MessageType, POSE_ARRAY, POSE_STAMPED,
    STRING, TEMPERATURE, TRANSFORMS,
};
use crate::pipeline::step_times::PipelineStep;
use std::borrow::Cow;

/// First part of the name in messages of the safety layer: `safety.STATE`.
pub(super) const SAFETY: &str = "safety";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)] // the table of the recorder's page
pub enum RecordingTopic {
    Motion,
    JointTargets,
    JointCommands,
    JointStates,
    ServoTruth,
    Beat,
    BeatPhase,
    Lead,
    Idle,
    BusBytes,
    BusPackets,
    Root,
    Spectrum,
    Temperatures,
    Safety,
    Transforms,
    FixedTransforms,
    Human,
    BeatMarker,
    Audio,
    RobotDescription,
    Stage(PipelineStep),
}

impl RecordingTopic {
    /// The topic's name in the file, and the type of its messages.
    pub(super) fn describe(self) -> (Cow<'static, str>, MessageType) {
        let (name, message_type) = match self {
            Self::Motion => ("/motion", POSE_ARRAY),
            Self::JointTargets => ("/joint_targets", JOINT_STATE),
            Self::JointCommands => ("/joint_commands", JOINT_STATE),
            Self::JointStates => ("/joint_states", JOINT_STATE),
            Self::ServoTruth => ("/servo_truth", JOINT_STATE),
            Self::Beat => ("/beat", FLOAT64),
            Self::BeatPhase => ("/beat_phase", FLOAT64),
            Self::Lead => ("/lead", FLOAT64),
            Self::Idle => ("/idle", FLOAT64),
            Self::BusBytes => ("/bus/bytes", FLOAT64),
            Self::BusPackets => ("/bus/packets", FLOAT64),
            Self::Root => ("/root", POSE_STAMPED),
            Self::RobotDescription => ("/robot_description", STRING),
            Self::Spectrum => ("/spectrum", FLOAT_ARRAY),
            Self::Temperatures => ("/temperatures", TEMPERATURE),
            Self::Safety => ("/safety", LOG),
            Self::Transforms => ("/tf", TRANSFORMS),
            Self::FixedTransforms => ("/tf_static", TRANSFORMS),
            Self::Human => ("/human", MARKER),
            Self::BeatMarker => ("/beat_marker", MARKER),
            Self::Audio => ("/audio", AUDIO),
            Self::Stage(stage) => return (format!("/stage/{}", stage.name()).into(), FLOAT64),
        };
        (name.into(), message_type)
    }
}
