//! The animation of a dance (GIF): ten seconds from its middle, drawn from the
//! trace of the run. For other parts of a dance: `--record` and `export`.

use crate::control::trace::Trace;
use crate::session::config::DanceConfig;
use crate::telemetry::export::{ExportSpan, gif};
use crate::telemetry::recorder::Recording;
use crate::telemetry::report::DanceReport;
use std::path::Path;

/// Length of the animation, seconds.
const LENGTH_S: f64 = 10.0;

/// Draws and writes the file; the motion was `lead_s` ahead of the music.
pub fn write(
    config: &DanceConfig,
    trace: &Trace,
    lead_s: f64,
    report: &DanceReport,
    path: &Path,
) -> anyhow::Result<()> {
    let [first_s, last_s] = match trace.servos.times_s() {
        [] => [0.0, 0.0],
        times_s => [times_s[0], times_s[times_s.len() - 1]],
    };
    let seconds = LENGTH_S.min(last_s - first_s);
    let from_s = first_s + (last_s - first_s - seconds) / 2.0;
    let shown = |time_s: f64| (from_s - 1.0..=from_s + seconds + 1.0).contains(&time_s);
    let recording = recording(config, trace, lead_s, report, shown)?;
    gif(&recording, ExportSpan { from_s, seconds }, path)
}

/// That part of the run as a recording of it would be.
fn recording(
    config: &DanceConfig,
    trace: &Trace,
    lead_s: f64,
    report: &DanceReport,
    shown: impl Fn(f64) -> bool,
) -> anyhow::Result<Recording> {
    let mut recording = Recording {
        robot: config.robot.name.clone(),
        urdf_xml: config.robot.urdf_xml.clone(),
        control_hz: config.robot.control_hz,
        joints: config.robot.joint_limits(),
        ..Recording::default()
    };
    let times_s = trace.servos.times_s().iter().enumerate();
    for (index, time_s) in times_s.filter(|(_, time_s)| shown(**time_s)) {
        let positions = trace.servos.sample(index);
        let positions = positions.iter().map(|p| *p as f32).collect();
        recording.states.push(*time_s, positions);
        recording.root.push(*time_s, trace.roots[index]);
    }
    for frame in trace.motion.iter().filter(|frame| shown(frame.time_s)) {
        let turned = |[left, up, forward]: [f32; 3]| [forward, left, up];
        let points = frame.positions.map(turned);
        recording.motion.push(frame.time_s, points);
    }
    recording.lead.push(0.0, lead_s);
    for time_s in &report.beats.times_s {
        recording.beats.push(*time_s, report.beats.tempo_bpm);
    }
    Ok(recording)
}
