//! A recording becomes other files: a moving picture, BVH, CSV.

use crate::joint_csv::JointCsv;
use crate::output::{PendingFile, write_whole};
use crate::picture::Figure;
use crate::picture::animation::{Animation, FRAMES_HZ, Moment};
use crate::picture::robot::{robot_figure, standing_height_m};
use crate::record::Recording;
use anyhow::bail;
use servodance_model::motion::{Clip, bvh_write};
use servodance_retarget::RobotModel;
use servodance_retarget::nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use servodance_types::FRAME_RATE_HZ;
use std::path::Path;

/// A part of a recording, seconds of music.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Its beginning.
    pub from_s: f64,
    /// Its length.
    pub seconds: f64,
}

/// What the servos reported, a line a control cycle.
///
/// # Errors
/// The file cannot be written.
pub fn csv(recording: &Recording, path: &Path) -> anyhow::Result<()> {
    let names: Vec<String> = recording.joints.iter().map(|j| j.0.clone()).collect();
    let mut csv = JointCsv::create(path, &names)?;
    for (time_s, positions) in recording.states.iter() {
        csv.write(time_s, positions.iter().map(|p| f64::from(*p)))?;
    }
    csv.finish()
}

/// The human motion, for animation programs.
///
/// # Errors
/// There is none, or the file cannot be written.
pub fn bvh(recording: &Recording, path: &Path) -> anyhow::Result<()> {
    let poses: Vec<_> = recording
        .motion
        .iter()
        .map(|(_, points)| points.map(with_y_up))
        .collect();
    if poses.is_empty() {
        bail!("the recording has no human motion to write as BVH");
    }
    let clip = Clip {
        name: recording.robot.clone(),
        fps: FRAME_RATE_HZ,
        poses,
    };
    write_whole(path, bvh_write::bvh(&clip).as_bytes())
}

/// The human and the robot, moving.
///
/// # Errors
/// The part is not in the recording, or the file cannot be written.
pub fn gif(recording: &Recording, part: Part, path: &Path) -> anyhow::Result<()> {
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
    let pending = PendingFile::create(path)?;
    let mut animation = Animation::new(pending.writer()?, &recording.robot)?;
    let mut height_m = None;
    for frame in 0..frames as u64 {
        let time_s = from_s + frame as f64 / FRAMES_HZ;
        let positions: Vec<f64> = match recording.states.at(time_s) {
            Some(positions) => positions.iter().map(|p| f64::from(*p)).collect(),
            None => continue,
        };
        let root = pose(recording.root_at(time_s));
        let height_m =
            *height_m.get_or_insert_with(|| standing_height_m(&model, &root, &positions));
        let lead_s = recording.lead.at(time_s).copied().unwrap_or(0.0);
        let human = recording.motion.at(time_s + lead_s);
        animation.push(&Moment {
            time_s,
            since_beat_s: recording
                .beats
                .last_before(time_s)
                .map(|beat| time_s - beat.0),
            human: human.map(|points| Figure::dancer(&points.map(with_y_up))),
            robot: Figure {
                height_m,
                ..robot_figure(&model, &root, &positions)
            },
        })?;
    }
    drop(animation.finish()?);
    pending.finish()
}

/// The axes of human motion: x left, y up, z forward.
fn with_y_up([forward, left, up]: [f32; 3]) -> [f32; 3] {
    [left, up, forward]
}

fn pose([x, y, z, i, j, k, w]: [f64; 7]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    Isometry3::from_parts(Translation3::new(x, y, z), turn)
}
