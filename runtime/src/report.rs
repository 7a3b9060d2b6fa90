//! The report of a dance: one JSON object, stable, for scripts to read.
//!
//! The keys are documented in `docs/report.md`; a change of meaning raises
//! [`Report::FORMAT`].

use crate::dance::LatencyReport;
use crate::stages::StageTimes;
use serde::{Deserialize, Serialize};
use servodance_audio::capture::CaptureStats;
use servodance_retarget::EffortReport;
use std::path::Path;

/// What `dance --report` writes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Report {
    /// Version of servodance that wrote it, and of this format: `0.1.0/2`.
    pub version: String,
    /// Seconds of audio heard.
    pub audio_s: f64,
    /// Motion frames generated, 20 a second.
    pub frames: u64,
    /// Motion tokens generated.
    pub tokens: u64,
    /// Seed of the generator.
    pub seed: u64,
    /// Name of the weights.
    pub model: String,
    /// Dance style asked for, if any.
    pub style: Option<String>,
    /// Name of the robot.
    pub robot: String,
    /// The bus: `sim`, `serial:PATH`, or `NAME=PORT` for each of several.
    pub bus: String,
    /// Wall-clock seconds from the first audio to torque off.
    pub wall_s: f64,
    /// Seconds of audio a wall-clock second.
    pub realtime_factor: f64,
    /// Time of each stage.
    pub stages: Stages,
    /// What went over the wire.
    pub bus_stats: BusReport,
    /// Limits broken at the simulated servos; `null` on a real bus, where
    /// nobody independent looks.
    pub violations: Option<ViolationReport>,
    /// Beats of the whole recording, found afterwards with all of it known.
    pub beats: BeatReport,
    /// How well motion and music beats agree, from the generator to the servos.
    pub alignment: AlignmentReport,
    /// Seconds that the robot idled because there was no music.
    pub idled_s: f64,
    /// What steering the motion onto the beat did.
    pub compensation: CompensationReport,
    /// When the joints paused, for scoring against other beats.
    pub kinematic_beats_s: KinematicBeats,
    /// Control cycles for which no motion frame was ready in time.
    pub late_frames: u64,
    /// What was left out because the machine was too slow, in this order: `picture`,
    /// `viewers`, `guidance`, `generator`.
    #[serde(default)]
    pub left_out: Vec<String>,
    /// From a captured sample to a usable motion frame and to a command on the
    /// wire, beyond the motion frame's own 50 ms; `null` unless audio is live.
    pub latency_ms: Option<LatencyReport>,
    /// What happened to live sound; `null` unless audio is live.
    pub capture: Option<CaptureReport>,
    /// How often the safety layer had to change a command.
    pub interventions: u64,
    /// What the dance asks of the motors, estimated before the safety layer.
    #[serde(default)]
    pub effort: EffortFigures,
    /// What the safety layer did, and why.
    pub safety: Vec<SafetyEvent>,
    /// Music frames with a number that was not finite, replaced by the last good one.
    pub replaced_music_frames: u64,
    /// Mean of the seconds by which motion was sent ahead of the music, so that it
    /// arrives on time; below zero when audio is live.
    pub lead_s: f64,
}

/// Percentiles of every stage.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Stages {
    /// Audio to features and beat, per 50 ms of audio.
    pub features: StageTimes,
    /// Features to motion, per motion frame.
    pub model: StageTimes,
    /// Motion to joint targets, per control cycle.
    pub retarget: StageTimes,
    /// Recording and bookkeeping, per control cycle.
    pub control: StageTimes,
    /// Bus exchange, per control cycle.
    pub bus: StageTimes,
}

/// One change of state of the safety layer, or a remark (`from` equals `to`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SafetyEvent {
    /// Robot time, seconds since torque on.
    pub time_s: f64,
    /// State before.
    pub from: String,
    /// State after.
    pub to: String,
    /// Why.
    pub cause: String,
    /// Whether a dance in which all goes well has it too.
    #[serde(skip)]
    pub routine: bool,
}

/// What went over the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BusReport {
    /// Control cycles.
    pub cycles: u64,
    /// Packets sent and received.
    pub packets: u64,
    /// Bytes sent and received.
    pub bytes: u64,
    /// Packets with a wrong checksum.
    pub crc_errors: u64,
    /// Replies that did not come in time.
    pub timeouts: u64,
    /// Requests sent again.
    pub retries: u64,
    /// Control cycles a second of robot time.
    pub rate_hz: f64,
}

/// Limits broken at the simulated servos, counted in cycles and joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ViolationReport {
    /// Told to go, or went, outside the position limits.
    pub position: u64,
    /// Told to move, or moved, faster than the velocity limit.
    pub velocity: u64,
    /// Told to, or did, change speed faster than the acceleration limit.
    pub acceleration: u64,
}

/// Torque and heat of the motors, estimated from the masses of the description.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffortFigures {
    /// Joints with a torque limit and something to carry: those that are known.
    pub known_joints: usize,
    /// The joint that came nearest to its torque limit, and the share of it.
    pub strongest: Option<JointShare>,
    /// The warmest motor at its warmest; 1 is where it would shut down.
    pub hottest: Option<JointShare>,
    /// Share of the movement that was left when it was lowered most to spare the
    /// motors; 1: it never was.
    pub lowest_amplitude: f64,
    /// Control cycles in which a joint needed more torque than its limit.
    pub overloaded_cycles: u64,
}

/// A joint and a share of something.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointShare {
    /// Name of the joint.
    pub joint: String,
    /// 1 is the limit.
    pub share: f64,
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

impl From<EffortReport> for EffortFigures {
    fn from(effort: EffortReport) -> Self {
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

/// What happened to live sound.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CaptureReport {
    /// How often sound was lost because nobody took it in time.
    pub overruns: u64,
    /// Seconds of sound lost that way.
    pub lost_s: f64,
    /// How often sound stayed away.
    pub stalls: u64,
    /// Seconds of silence heard in its place.
    pub silence_s: f64,
    /// Seconds of sound left out because it came too late.
    pub dropped_s: f64,
    /// How often the device was opened, the first time included.
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

/// Beats of the recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BeatReport {
    /// Median tempo; 0 where there is no beat.
    pub tempo_bpm: f64,
    /// Times of the beats, seconds.
    pub times_s: Vec<f64>,
}

/// Beat alignment in both published directions and as F1; `null` where there
/// is no music beat to align with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AlignmentScores {
    /// From each kinematic beat to the nearest music beat (AIST++/FACT).
    pub fact: Option<f64>,
    /// From each music beat to the nearest kinematic beat (Bailando).
    pub bailando: Option<f64>,
    /// F1 of kinematic against music beats within 100 ms.
    pub f1: Option<f64>,
    /// Median distance from a kinematic beat to the nearest music beat, milliseconds.
    pub error_ms: Option<f64>,
    /// The same with its sign: above zero where the motion is late.
    pub bias_ms: Option<f64>,
}

/// What steering the motion onto the beat did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CompensationReport {
    /// Whether it was on.
    pub on: bool,
    /// Slowest and fastest pace of the motion; 1 is as it was generated.
    pub pace: [f64; 2],
    /// Alignment of the same motion danced again without it on simulated servos
    /// (its first ten minutes): targets. `null` if compensation was off.
    pub off_targets: Option<AlignmentScores>,
    /// The same: servos.
    pub off_servos: Option<AlignmentScores>,
}

/// Kinematic beats: the moments at which the joints pause, seconds of music.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KinematicBeats {
    /// Of the 22-joint motion.
    pub generator: Vec<f64>,
    /// Of the joint targets.
    pub targets: Vec<f64>,
    /// Of the positions that the servos reported.
    pub servos: Vec<f64>,
    /// Of the servos without compensation; empty if it was off.
    pub off_servos: Vec<f64>,
}

/// Alignment along the way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AlignmentReport {
    /// Of the 22-joint motion.
    pub generator: AlignmentScores,
    /// Of the joint targets, before the servos' lag.
    pub targets: AlignmentScores,
    /// Of the positions that the servos reported.
    pub servos: AlignmentScores,
}

impl Report {
    /// Version of the format.
    pub const FORMAT: u32 = 2;

    /// The value of [`Report::version`].
    pub fn version_string() -> String {
        format!("{}/{}", env!("CARGO_PKG_VERSION"), Self::FORMAT)
    }

    /// Writes the report as indented JSON, whole or not at all.
    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        let mut text = serde_json::to_string_pretty(self)?;
        text.push('\n');
        crate::output::write_whole(path, text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effort(lowest_amplitude: f64) -> EffortFigures {
        EffortReport {
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
        assert!(
            line.contains("down to 60 %") && line.contains("92 %"),
            "{line}"
        );
        assert!(
            line.contains("(hip)") && line.contains("71 % (knee)"),
            "{line}"
        );
        assert!(!effort(1.0).line().unwrap().contains("less"));
        assert_eq!(EffortFigures::default().line(), None);
    }
}
