//! Plot selection: which part of a dance its picture shows, and which joints.

use crate::control::trace::{JointTrace, Trace};
use crate::session::config::DanceConfig;
use crate::telemetry::picture::robot_figure::{robot_figure, standing_height_m};
use crate::telemetry::picture::{BeatPose, DancePicture, JointTrack, StickFigure};
use crate::telemetry::pose_array::pose_from_array;
use crate::telemetry::report::DanceReport;
use servodance_model::motion::kinematic_beats_s;
use servodance_retarget::Retargeter;

/// Beats, and so poses, in a picture.
const POSES: usize = 14;
/// Seconds between poses where the music has no beat.
const OFFBEAT_STEP_S: f64 = 0.5;
const TRACKS: usize = 8;

pub fn plot(
    config: &DanceConfig,
    trace: &Trace,
    trace_hz: f64,
    report: &DanceReport,
) -> anyhow::Result<DancePicture> {
    let retargeter = config.robot.retargeter()?;
    let rest = retargeter.rest();
    let height_m = standing_height_m(retargeter.model(), &retargeter.world_from_root(rest), rest);
    let moments = moments(&report.beats.times_s, report.audio_s);
    let margin_s = 0.3;
    let window_s = (
        moments.first().copied().unwrap_or(0.0) - margin_s,
        moments.last().copied().unwrap_or(1.0) + margin_s,
    );
    let speed = trace.servos.mean_speed(trace_hz);
    let speed_track = trace.servos.times_s().iter().copied().zip(speed.iter().copied());
    Ok(DancePicture {
        title: format!("servodance: {} dances to {}", report.robot, song_name(config)),
        subtitle: subtitle(report),
        window_s,
        poses: moments
            .iter()
            .filter_map(|time_s| pose(&retargeter, height_m, trace, *time_s))
            .collect(),
        beats_s: report.beats.times_s.clone(),
        kinematic_beats_s: kinematic_beats_s(&speed, trace_hz),
        speed: speed_track.collect(),
        tracks: liveliest_tracks(config, &trace.servos, window_s),
    })
}

fn song_name(config: &DanceConfig) -> String {
    match &config.audio {
        crate::pipeline::audio_input::AudioChoice::BuiltIn => "its built-in song".into(),
        crate::pipeline::audio_input::AudioChoice::Recorded(_) => "a recorded song".into(),
        crate::pipeline::audio_input::AudioChoice::Stdin(_)
        | crate::pipeline::audio_input::AudioChoice::Microphone(_)
        | crate::pipeline::audio_input::AudioChoice::Page(_) => "live audio".into(),
        crate::pipeline::audio_input::AudioChoice::File(path) => {
            path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
        }
    }
}

fn subtitle(report: &DanceReport) -> String {
    let broken = report.violations.map(|v| v.position + v.velocity + v.acceleration);
    let limits = match broken {
        Some(count) => format!("{count} limits broken at the servos"),
        None => "real servos: limits not judged".into(),
    };
    let f1 =
        report.alignment.servos.f1.map_or("no beat found".into(), |f1| format!("beat F1 {f1:.2}"));
    format!(
        "{:.1} s, {:.0} BPM, seed {}, {f1}, {limits}, {:.1}x real time",
        report.audio_s, report.beats.tempo_bpm, report.seed, report.realtime_factor
    )
}

/// Successive beats from the middle of the song.
fn moments(beats_s: &[f64], audio_s: f64) -> Vec<f64> {
    if beats_s.len() >= 4 {
        let first = beats_s.len().saturating_sub(POSES) / 2;
        return beats_s.iter().copied().skip(first).take(POSES).collect();
    }
    let span_s = POSES as f64 * OFFBEAT_STEP_S;
    let first_s = ((audio_s - span_s) / 2.0).max(0.0);
    (0..POSES).map(|i| first_s + i as f64 * OFFBEAT_STEP_S).filter(|t| *t < audio_s).collect()
}

fn pose(retargeter: &Retargeter, height_m: f64, trace: &Trace, time_s: f64) -> Option<BeatPose> {
    let frame = trace.motion.iter().find(|frame| frame.time_s >= time_s - 1e-9)?;
    let index = trace.servos.index_at(time_s)?;
    let positions = trace.servos.sample(index);
    let root = pose_from_array(*trace.roots.get(index)?);
    Some(BeatPose {
        time_s,
        dancer: StickFigure::dancer(&frame.positions),
        robot: StickFigure { height_m, ..robot_figure(retargeter.model(), &root, positions) },
    })
}

/// The joints that moved through the widest ranges in the window.
fn liveliest_tracks(
    config: &DanceConfig,
    servos: &JointTrace,
    window_s: (f64, f64),
) -> Vec<JointTrack> {
    let mut tracks: Vec<(f64, JointTrack)> = config
        .robot
        .servos
        .iter()
        .enumerate()
        .map(|(i, servo)| {
            let samples: Vec<(f64, f64)> =
                servos.joint(i).filter(|(t, _)| (window_s.0..=window_s.1).contains(t)).collect();
            let positions = samples.iter().map(|s| s.1);
            let (low, high) = positions
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
            let track = JointTrack {
                name: servo.name.clone(),
                lower_rad: servo.limits.lower_rad,
                upper_rad: servo.limits.upper_rad,
                samples,
            };
            (high - low, track)
        })
        .collect();
    tracks.sort_by(|a, b| b.0.total_cmp(&a.0));
    tracks.into_iter().take(TRACKS).map(|(_, track)| track).collect()
}
