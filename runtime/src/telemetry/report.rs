//! The report of a dance: one JSON object, stable, for scripts to read.
//!
//! Meaning and unit of each key stand in `docs/report.md`, which a test holds
//! against this file; a change of meaning raises [`DanceReport::FORMAT`].

use super::following_report::{FollowingReport, ServoErrorReport};
pub use super::joint_share::JointShare;
pub use super::violation_report::ViolationReport;
use crate::control::latency::LatencyReport;
use crate::pipeline::step_times::StepTimes;
use crate::world::BodyReport;
use serde::{Deserialize, Serialize};
use servodance_audio::capture::CaptureStats;
use servodance_retarget::TorqueReport;
use std::path::Path;

/// What `dance --report` writes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DanceReport {
    pub version: String,
    pub audio_s: f64,
    pub frames: u64,
    pub tokens: u64,
    pub seed: u64,
    pub model: String,
    pub style: Option<String>,
    pub robot: String,
    pub bus: String,
    pub wall_s: f64,
    pub realtime_factor: f64,
    pub stages: PipelineTimes,
    pub bus_stats: BusReport,
    #[serde(default)]
    pub cycle_gaps: Option<StepTimes>,
    #[serde(default)]
    pub servo_errors: Vec<ServoErrorReport>,
    #[serde(default)]
    pub following: FollowingReport,
    pub violations: Option<ViolationReport>,
    #[serde(default)]
    pub body: Option<BodyReport>,
    pub beats: BeatReport,
    pub alignment: AlignmentReport,
    pub idled_s: f64,
    pub compensation: CompensationReport,
    pub kinematic_beats_s: KinematicBeats,
    pub late_frames: u64,
    #[serde(default)]
    pub left_out: Vec<String>,
    pub latency_ms: Option<LatencyReport>,
    pub capture: Option<CaptureReport>,
    pub interventions: u64,
    #[serde(default)]
    pub effort: EffortFigures,
    pub steps: Option<StepFigures>,
    pub safety: Vec<SafetyEvent>,
    pub replaced_music_frames: u64,
    pub lead_s: f64,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct PipelineTimes {
    pub features: StepTimes,
    pub model: StepTimes,
    pub retarget: StepTimes,
    pub control: StepTimes,
    pub bus: StepTimes,
}

/// One change of state of the safety layer, or a remark (`from` equals `to`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SafetyEvent {
    pub time_s: f64,
    pub from: String,
    pub to: String,
    pub cause: String,
    /// Whether a dance in which all goes well has it too.
    #[serde(skip)]
    pub routine: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BusReport {
    pub cycles: u64,
    pub packets: u64,
    pub bytes: u64,
    pub crc_errors: u64,
    pub timeouts: u64,
    pub retries: u64,
    pub rate_hz: f64,
    /// What adapter and system add to the time of answers, over the last cycles; 0 in
    /// simulated time.
    #[serde(default)]
    pub delay_ms: f64,
}

/// Steps of a robot of stance `stepping`: those that it made, and those of the dancer that
/// balance refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepFigures {
    pub made: u64,
    pub refused: u64,
}

/// Torque and heat of the motors, estimated from the masses of the description.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffortFigures {
    pub known_joints: usize,
    pub strongest: Option<JointShare>,
    pub hottest: Option<JointShare>,
    pub lowest_amplitude: f64,
    pub overloaded_cycles: u64,
}

impl Default for EffortFigures {
    fn default() -> Self {
        Self {
            known_joints: 0,
            strongest: None,
            hottest: None,
            lowest_amplitude: 1.0,
            overloaded_cycles: 0,
        }
    }
}

impl From<TorqueReport> for EffortFigures {
    fn from(effort: TorqueReport) -> Self {
        let share = |(joint, share)| JointShare { joint, share };
        Self {
            known_joints: effort.known_joints,
            strongest: effort.strongest.map(share),
            hottest: effort.hottest.map(share),
            lowest_amplitude: effort.lowest_amplitude,
            overloaded_cycles: effort.overloaded_cycles,
        }
    }
}

impl EffortFigures {
    /// A line for people; `None` where nothing is known of the motors.
    pub fn line(&self) -> Option<String> {
        let (strongest, hottest) = (self.strongest.as_ref()?, self.hottest.as_ref()?);
        let most = format!(
            "torque at most {:.0} % of the limit ({}), heat {:.0} % ({}), estimated",
            strongest.share * 100.0,
            strongest.joint,
            hottest.share * 100.0,
            hottest.joint
        );
        Some(match self.lowest_amplitude < 0.995 {
            true => format!(
                "moved less to spare them, down to {:.0} %: {most}",
                self.lowest_amplitude * 100.0
            ),
            false => most,
        })
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CaptureReport {
    pub overruns: u64,
    pub lost_s: f64,
    pub stalls: u64,
    pub silence_s: f64,
    pub dropped_s: f64,
    pub opened: u64,
}

impl From<CaptureStats> for CaptureReport {
    fn from(stats: CaptureStats) -> Self {
        Self {
            overruns: stats.overruns,
            lost_s: stats.lost_s,
            stalls: stats.stalls,
            silence_s: stats.silence_s,
            dropped_s: stats.dropped_s,
            opened: stats.opened,
        }
    }
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BeatReport {
    pub tempo_bpm: f64,
    pub times_s: Vec<f64>,
    #[serde(default)]
    pub meter: Option<u8>,
    #[serde(default)]
    pub meter_confidence: f32,
}

/// Beat alignment in both published directions and as F1; `null` where there
/// is no music beat to align with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AlignmentScores {
    pub fact: Option<f64>,
    pub bailando: Option<f64>,
    pub f1: Option<f64>,
    pub error_ms: Option<f64>,
    pub bias_ms: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CompensationReport {
    pub on: bool,
    pub pace: [f64; 2],
    pub off_targets: Option<AlignmentScores>,
    pub off_servos: Option<AlignmentScores>,
}

/// Kinematic beats: the moments at which the joints pause, seconds of music.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KinematicBeats {
    pub generator: Vec<f64>,
    pub targets: Vec<f64>,
    pub servos: Vec<f64>,
    pub off_servos: Vec<f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AlignmentReport {
    pub generator: AlignmentScores,
    pub targets: AlignmentScores,
    pub servos: AlignmentScores,
}

impl DanceReport {
    pub const FORMAT: u32 = 2;

    /// The value of [`DanceReport::version`].
    pub fn version_string() -> String {
        format!("{}/{}", env!("CARGO_PKG_VERSION"), Self::FORMAT)
    }

    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        let mut text = serde_json::to_string_pretty(self)?;
        text.push('\n');
        crate::telemetry::pending_file::write_whole(path, text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effort(lowest_amplitude: f64) -> EffortFigures {
        TorqueReport {
            known_joints: 2,
            hottest: Some(("knee".into(), 0.71)),
            strongest: Some(("hip".into(), 0.92)),
            lowest_amplitude,
            overloaded_cycles: 0,
        }
        .into()
    }

    #[test]
    fn a_dance_made_smaller_for_the_motors_is_said() {
        let line = effort(0.6).line().unwrap();
        assert!(line.contains("down to 60 %") && line.contains("92 %"), "{line}");
        assert!(line.contains("(hip)") && line.contains("71 % (knee)"), "{line}");
        assert!(!effort(1.0).line().unwrap().contains("less"));
        assert_eq!(EffortFigures::default().line(), None);
    }
}
