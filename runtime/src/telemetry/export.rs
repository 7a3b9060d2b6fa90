//! A recording becomes other files: a moving picture, a film with sound, BVH, CSV.

use crate::telemetry::film::write_film;
use crate::telemetry::joint_csv::JointCsv;
use crate::telemetry::pending_file::{PendingFile, write_whole};
use crate::telemetry::picture::StickFigure;
use crate::telemetry::picture::animation::{AnimationFrame, FRAMES_HZ, write_animation};
use crate::telemetry::picture::robot_figure::{robot_figure, standing_height_m};
use crate::telemetry::pose_array::pose_from_array;
use crate::telemetry::recorder::Recording;
use anyhow::bail;
use servodance_model::motion::{Clip, bvh_write};
use servodance_retarget::RobotModel;
use servodance_types::FRAME_RATE_HZ;
use std::path::Path;

/// A part of a recording, seconds of music.
#[derive(Clone, Copy, Debug)]
#[allow(missing_docs)] // the names say it
pub struct ExportSpan {
    pub from_s: f64,
    pub seconds: f64,
}

/// What the servos reported, a line a control cycle.
pub fn csv(recording: &Recording, path: &Path) -> anyhow::Result<()> {
    let names: Vec<String> = recording.joints.iter().map(|j| j.0.clone()).collect();
    let mut csv = JointCsv::create(path, &names)?;
    for (time_s, positions) in recording.states.iter() {
        csv.write(time_s, positions.iter().map(|p| f64::from(*p)))?;
    }
    csv.finish()
}

/// The human motion, for animation programs; fails if there is none.
pub fn bvh(recording: &Recording, path: &Path) -> anyhow::Result<()> {
    let poses: Vec<_> = recording.motion.iter().map(|(_, points)| points.map(with_y_up)).collect();
    if poses.is_empty() {
        bail!("the recording has no human motion to write as BVH");
    }
    let clip = Clip { name: recording.robot.clone(), fps: FRAME_RATE_HZ, poses };
    write_whole(path, bvh_write::bvh(&clip).as_bytes())
}

/// The human and the robot, moving; fails if the part is not in the recording.
pub fn gif(recording: &Recording, part: ExportSpan, path: &Path) -> anyhow::Result<()> {
    let moments = moments(recording, part)?;
    let pending = PendingFile::create(path)?;
    drop(write_animation(pending.writer()?, &recording.robot, &moments)?);
    pending.finish()
}

/// The same with the song, as MP4 or WebM; what encoded it, in words.
pub fn film(recording: &Recording, part: ExportSpan, path: &Path) -> anyhow::Result<String> {
    write_film(recording, &moments(recording, part)?, path)
}

/// What is drawn, 25 times a second of the part.
fn moments(recording: &Recording, part: ExportSpan) -> anyhow::Result<Vec<AnimationFrame>> {
    let [first_s, last_s] = recording.span_s();
    let from_s = part.from_s.max(first_s);
    let frames = ((part.seconds.min(last_s - from_s)) * FRAMES_HZ).floor();
    if !(1.0..=100_000.0).contains(&frames) {
        bail!(
            "the recording goes from {first_s:.1} to {last_s:.1} s: no picture from {} s on",
            part.from_s
        );
    }
    let names: Vec<&str> = recording.joints.iter().map(|j| j.0.as_str()).collect();
    let model = RobotModel::new(&recording.urdf_xml, &names)?;
    let mut moments = Vec::with_capacity(frames as usize);
    let mut height_m = None;
    for frame in 0..frames as u64 {
        let time_s = from_s + frame as f64 / FRAMES_HZ;
        let positions: Vec<f64> = match recording.states.at(time_s) {
            Some(positions) => positions.iter().map(|p| f64::from(*p)).collect(),
            None => continue,
        };
        let root = pose_from_array(recording.root_at(time_s));
        let height_m =
            *height_m.get_or_insert_with(|| standing_height_m(&model, &root, &positions));
        let lead_s = recording.lead.at(time_s).copied().unwrap_or(0.0);
        let human = recording.motion.at(time_s + lead_s);
        moments.push(AnimationFrame {
            time_s,
            since_beat_s: recording.beats.last_before(time_s).map(|beat| time_s - beat.0),
            human: human.map(|points| StickFigure::dancer(&points.map(with_y_up))),
            robot: StickFigure { height_m, ..robot_figure(&model, &root, &positions) },
        });
    }
    Ok(moments)
}

fn with_y_up([forward, left, up]: [f32; 3]) -> [f32; 3] {
    [left, up, forward]
}
