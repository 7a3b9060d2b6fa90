//! What the user reads when a dance is over.

use crate::session::config::DanceConfig;
use crate::telemetry::report::{BusReport, DanceReport};
use std::fmt::Write;

/// A few lines: what was danced, how well, how fast, and where the files are.
pub fn summary(config: &DanceConfig, report: &DanceReport) -> String {
    let mut text = String::new();
    let mut line = |label: &str, value: String| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{label:<10}{value}");
    };
    let DanceReport { audio_s, wall_s, realtime_factor, frames, seed, model, .. } = report;
    line(
        "danced",
        format!(
            "{audio_s:.1} s of music in {wall_s:.1} s ({realtime_factor:.1}x real time), \
             {frames} frames, seed {seed}, model {model}"
        ),
    );
    let beats = report.beats.times_s.len();
    let meter = report.beats.meter.map_or(String::new(), |meter| {
        format!(", {meter} a bar ({:.0} % sure)", 100.0 * report.beats.meter_confidence)
    });
    line(
        "beats",
        match (beats, report.alignment.servos.f1) {
            (0, _) | (_, None) => "none found in this audio".into(),
            (_, Some(f1)) => format!(
                "{beats} at {:.0} BPM{meter}; within 100 ms of them (F1): dancer {:.2}, servos {f1:.2}, {:.0} ms off",
                report.beats.tempo_bpm,
                report.alignment.generator.f1.unwrap_or_default(),
                report.alignment.servos.error_ms.unwrap_or_default(),
            ),
        },
    );
    let DanceReport { robot, bus, late_frames, .. } = report;
    let BusReport { cycles, rate_hz, bytes, crc_errors, timeouts, .. } = report.bus_stats;
    let errors = crc_errors + timeouts;
    line(
        "robot",
        format!(
            "{robot} on {bus}: {cycles} cycles at {rate_hz:.0} Hz, {bytes} bytes, \
             {errors} errors, {late_frames} late{}",
            longest_gap(config, report)
        ),
    );
    if let Some(following) = report.following.line() {
        line("followed", following);
    }
    if let Some(latency) = &report.latency_ms {
        line(
            "latency",
            format!(
                "sample in to command out, beyond the frame of 50 ms: median {:.1} ms, p99 {:.1} ms",
                latency.command.p50_ms, latency.command.p99_ms
            ),
        );
    }
    line(
        "limits",
        match report.violations {
            Some(v) => format!(
                "broken at the servos: position {}, velocity {}, acceleration {}",
                v.position, v.velocity, v.acceleration
            ),
            None => "held by the safety layer (real servos: nobody independent looked)".into(),
        },
    );
    if let Some(body) = &report.body {
        line("body", body.line());
    }
    if let Some(steps) = report.steps {
        line("steps", format!("{} made, {} refused by balance", steps.made, steps.refused));
    }
    if let Some(effort) = report.effort.line() {
        line("motors", effort);
    }
    let remarks = report.safety.iter().filter(|event| !event.routine);
    if let Some(last) = remarks.clone().next_back() {
        let count = remarks.count();
        line("safety", format!("{count} remarks, the last: {}", last.cause));
    }
    for (label, path) in
        [("picture", &config.picture), ("report", &config.report), ("recording", &config.record)]
    {
        if let Some(path) = path {
            line(label, path.display().to_string());
        }
    }
    text
}

/// The longest time between two commands, where the robot felt it.
fn longest_gap(config: &DanceConfig, report: &DanceReport) -> String {
    let long_ms = 2.0 * config.robot.period_s() * 1e3;
    match report.cycle_gaps.filter(|gaps| gaps.max_ms > long_ms) {
        Some(gaps) => format!(", longest gap {:.0} ms", gaps.max_ms),
        None => String::new(),
    }
}
