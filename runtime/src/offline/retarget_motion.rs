//! A motion file becomes a file of joint positions, inside every limit.

use crate::offline::motion_tracking::{TrackedMotion, track_motion};
use crate::process::wrong_usage::misused;
use crate::robot::Robot;
use crate::telemetry::joint_csv::JointCsv;
use crate::telemetry::pending_file::{PendingFile, write_whole};
use crate::telemetry::recorder::{Recorder, RecordingTopic, WhenBehind};
use crate::telemetry::report::{EffortFigures, ViolationReport};
use serde::Serialize;
use servodance_model::motion::Clip;
use servodance_retarget::{LimbSegment, RetargetCounts};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The motion, the robot, and the files to write.
#[derive(Clone, Debug, clap::Args)]
pub struct RetargetRequest {
    /// The motion: .bvh, .npz (22 joints), .pkl (AIST++), .amc beside its .asf, or .npy (HumanML3D).
    #[arg(value_name = "MOTION")]
    pub motion: PathBuf,
    /// A built-in robot (see `servodance robots`) or a robot file.
    #[arg(long, default_value = "op3", value_name = "NAME|FILE.toml")]
    pub robot: String,
    /// Joint positions: `time_s` and a column of radians a joint (.csv),
    /// or a recording (.mcap); the first row is the pose of the first frame.
    #[arg(long, value_name = "FILE.csv|.mcap")]
    pub out: PathBuf,
    /// Write figures as JSON.
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Print only errors
    #[arg(long, short)]
    pub quiet: bool,
}

/// The figures of `retarget --report`.
#[derive(Clone, Debug, Serialize)]
struct RetargetReport {
    motion: String,
    robot: String,
    control_hz: f64,
    cycles: u64,
    violations: ViolationReport,
    /// Joint cycles in which the safety layer changed a command.
    interventions: u64,
    counts: RetargetCounts,
    /// Median angle between the dancer's arm segments and the robot's, degrees;
    /// `null` where the robot has no arms.
    direction_error_median_deg: Option<f64>,
    /// 95 of 100 are smaller.
    direction_error_p95_deg: Option<f64>,
    /// Median angle by segment, degrees, legs too: they follow from pelvis and
    /// feet where the robot stands. `null` where the robot has none.
    segment_error_median_deg: SegmentErrors,
    effort: EffortFigures,
    jerk_rms_rad_s3: f64,
    /// Mean time of a retargeting cycle, microseconds.
    us_mean: f64,
    /// 99 of 100 cycles take less.
    us_p99: f64,
}

/// An angle for each kind of limb segment.
#[derive(Clone, Copy, Debug, Serialize)]
struct SegmentErrors {
    upper_arm: Option<f64>,
    forearm: Option<f64>,
    thigh: Option<f64>,
    shank: Option<f64>,
}

/// Reads the motion, tracks it, writes the files; returns lines for the user.
/// Nothing is written if anything is refused.
pub fn retarget(
    request: &RetargetRequest,
    read_motion: impl FnOnce(&Path) -> anyhow::Result<(Clip, Vec<String>)>,
) -> anyhow::Result<Vec<String>> {
    let robot = Robot::load(&request.robot)?;
    let names: Vec<String> = robot.servos.iter().map(|servo| servo.name.clone()).collect();
    let mut sink = JointSink::create(&request.out, &names, &robot.urdf_xml)?;
    let report_file = request.report.as_deref().map(PendingFile::create);
    drop(report_file.transpose()?); // only to learn early whether it can be written
    let (clip, mut lines) = read_motion(&request.motion)?;
    let tracked = track_motion(&robot, &clip.frames(), |time_s, positions_rad| {
        sink.write(time_s, positions_rad)
    })?;
    let report = report(&clip.name, &robot, &tracked);
    sink.finish(&robot)?;
    if let Some(path) = &request.report {
        let mut text = serde_json::to_string_pretty(&report)?;
        text.push('\n');
        write_whole(path, text.as_bytes())?;
    }
    lines.extend(summary(&report, &request.out));
    Ok(lines)
}

fn report(motion: &str, robot: &Robot, tracked: &TrackedMotion) -> RetargetReport {
    let errors = &tracked.direction_errors_deg;
    let error = |share| (!errors.is_empty()).then(|| TrackedMotion::quantile(errors, share));
    let median = |segment| tracked.median_deg(|other| other == segment);
    let times = &tracked.cycle_us;
    RetargetReport {
        motion: motion.to_owned(),
        robot: robot.name.clone(),
        control_hz: robot.control_hz,
        cycles: tracked.cycles,
        violations: tracked.violations,
        interventions: tracked.interventions,
        counts: tracked.counts,
        direction_error_median_deg: error(0.5),
        direction_error_p95_deg: error(0.95),
        segment_error_median_deg: SegmentErrors {
            upper_arm: median(LimbSegment::UpperArm),
            forearm: median(LimbSegment::Forearm),
            thigh: median(LimbSegment::Thigh),
            shank: median(LimbSegment::Shank),
        },
        effort: tracked.effort.clone().into(),
        jerk_rms_rad_s3: tracked.jerk_rms_rad_s3,
        us_mean: times.iter().sum::<f64>() / times.len().max(1) as f64,
        us_p99: TrackedMotion::quantile(times, 0.99),
    }
}

fn summary(report: &RetargetReport, out: &Path) -> Vec<String> {
    let broken = report.violations;
    let mut lines = vec![format!(
        "{}: {} cycles of {} on {}",
        out.display(),
        report.cycles,
        report.motion,
        report.robot
    )];
    if let (Some(median), Some(p95)) =
        (report.direction_error_median_deg, report.direction_error_p95_deg)
    {
        lines.push(format!(
            "arms point within {median:.1} degrees of the dancer's (median), {p95:.1} (95 %)"
        ));
    }
    lines.push(format!(
        "limits broken: {} position, {} velocity, {} acceleration; {} commands changed by the \
         safety layer; {:.0} us a cycle",
        broken.position, broken.velocity, broken.acceleration, report.interventions, report.us_mean
    ));
    lines.extend(report.effort.line().map(|effort| format!("motors: {effort}")));
    lines
}

enum JointSink {
    Csv(JointCsv),
    Recording(Box<Recorder>),
}

impl JointSink {
    fn create(path: &Path, names: &[String], urdf_xml: &str) -> anyhow::Result<Self> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("csv") => Ok(JointSink::Csv(JointCsv::create(path, names)?)),
            Some("mcap") => {
                let silent = Box::new(|_: &str| ()); // `finish` tells
                let mut recorder =
                    Recorder::create(path, names.to_vec(), WhenBehind::Wait, silent)?;
                recorder.text(RecordingTopic::RobotDescription, 0.0, urdf_xml);
                Ok(JointSink::Recording(Box::new(recorder)))
            }
            _ => misused!("{}: joint positions go to a .csv or .mcap file", path.display()),
        }
    }

    fn write(&mut self, time_s: f64, positions_rad: &[f64]) -> anyhow::Result<()> {
        match self {
            JointSink::Csv(csv) => csv.write(time_s, positions_rad.iter().copied()),
            JointSink::Recording(recorder) => {
                recorder.positions(RecordingTopic::JointCommands, time_s, positions_rad);
                Ok(())
            }
        }
    }

    fn finish(self, robot: &Robot) -> anyhow::Result<()> {
        match self {
            JointSink::Csv(csv) => csv.finish(),
            JointSink::Recording(mut recorder) => {
                recorder.metadata(BTreeMap::from([
                    ("robot".to_owned(), robot.name.clone()),
                    ("control_hz".to_owned(), robot.control_hz.to_string()),
                ]));
                recorder.finish()
            }
        }
    }
}
