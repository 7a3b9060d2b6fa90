//! Whether a dance that is over was one.

use super::config::DanceConfig;
use crate::control::robot_buses::RobotBuses;
use crate::control::trace::Trace;
use crate::telemetry::JointSpans;
use crate::telemetry::report::DanceReport;

/// Less amplitude, or less music, need not move a robot.
const LEAST_AMPLITUDE: f64 = 0.2;
const LEAST_MUSIC_S: f64 = 5.0;

/// Fails for: a robot that fell, a broken limit, servos that did not follow, a robot that stood
/// still.
pub(super) fn verdict(
    config: &DanceConfig,
    report: &DanceReport,
    trace: &Trace,
    servos: &RobotBuses,
) -> anyhow::Result<()> {
    refuse_fall(servos)?;
    refuse_broken_limits(report, servos)?;
    report.following.refuse_frozen()?;
    refuse_still(config, report, trace)
}

/// A dance in which the robot fell has failed.
fn refuse_fall(servos: &RobotBuses) -> anyhow::Result<()> {
    match servos.fall_s() {
        Some(fell_s) => {
            anyhow::bail!("the robot fell {fell_s:.2} s after torque on; torque is off")
        }
        None => Ok(()),
    }
}

/// Simulated servos count broken limits; a dance with any has failed.
fn refuse_broken_limits(report: &DanceReport, servos: &RobotBuses) -> anyhow::Result<()> {
    if let Some(counted) = report.violations.filter(|v| *v != Default::default()) {
        anyhow::bail!(
            "the simulated servos saw limits broken: {} position, {} velocity, {} acceleration; first: {}",
            counted.position,
            counted.velocity,
            counted.acceleration,
            servos.violation_notes().first().cloned().unwrap_or_default()
        );
    }
    Ok(())
}

/// People who watch and steer may have wanted a still robot.
fn refuse_still(config: &DanceConfig, report: &DanceReport, trace: &Trace) -> anyhow::Result<()> {
    let music_s = report.audio_s - report.idled_s;
    let asked = config.robot.retarget.amplitude >= LEAST_AMPLITUDE && music_s >= LEAST_MUSIC_S;
    if !asked || config.view.is_some() || config.tui {
        return Ok(());
    }
    let targets = &trace.targets;
    let mut moved = JointSpans::new(config.robot.servos.len());
    (0..targets.times_s().len()).for_each(|sample| moved.see(targets.sample(sample)));
    moved.refuse_still()
}
