//! Reads AIST++ motion: SMPL joint angles in a pickle, 60 frames a second.
//!
//! The angles move our own skeleton from a plain T-pose: SMPL's own offsets are
//! model data under a licence of their own. Directions of limbs agree to some
//! degrees; hands and body shape are left out.

use std::path::Path;

use servodance_types::{BodyJoint, JOINT_COUNT};

use super::bvh_write::rest_direction;
use super::pickle::{Array, arrays};
use super::rotation::{IDENTITY, about, apply, multiply};
use super::skeleton::BONE_LENGTH_M;
use super::vec3::{add, narrow, scale, unit_or};
use super::{Clip, MotionError, Pose};

/// Frames a second of the data set.
const FPS: f64 = 60.0;
/// Angles a frame: 24 joints, three each.
const ANGLES: usize = 72;

/// Reads `smpl_poses`, `smpl_trans` and `smpl_scaling`.
pub fn read_aist(path: &Path) -> Result<Clip, MotionError> {
    let bytes = std::fs::read(path).map_err(|error| MotionError::Read {
        path: path.to_owned(),
        reason: error.to_string(),
    })?;
    let content = |reason: String| MotionError::Content {
        path: path.to_owned(),
        reason,
    };
    let arrays = arrays(&bytes).map_err(content)?;
    let get = |key: &str| {
        let mut names: Vec<_> = arrays.keys().map(String::as_str).collect();
        names.sort_unstable();
        arrays.get(key).ok_or_else(|| {
            content(format!(
                "no array `{key}`; the file has: {}",
                names.join(", ")
            ))
        })
    };
    let (poses, places) = (get("smpl_poses")?, get("smpl_trans")?);
    let size = arrays
        .get("smpl_scaling")
        .and_then(|array| array.values.first());
    let size = size.copied().unwrap_or(1.0);
    if !size.is_finite() || size.abs() < 1e-9 {
        return Err(content(format!("`smpl_scaling` is {size}")));
    }
    let frames = poses.shape.first().copied().unwrap_or(0);
    check(poses, frames * ANGLES, "smpl_poses", "frames x 72").map_err(content)?;
    check(places, frames * 3, "smpl_trans", "frames x 3").map_err(content)?;
    if frames == 0 {
        return Err(content("there are no frames".into()));
    }
    let (places, _) = places.values.as_chunks::<3>();
    let angles = poses.values.chunks_exact(ANGLES);
    let poses = angles
        .zip(places)
        .map(|(angles, place)| pose(angles, scale(*place, 1.0 / size)));
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    Ok(Clip {
        name: name.into_owned(),
        fps: FPS,
        poses: poses.collect(),
    })
}

fn check(array: &Array, numbers: usize, key: &str, wanted: &str) -> Result<(), String> {
    if array.values.len() != numbers {
        return Err(format!("`{key}` is {:?}, expected {wanted}", array.shape));
    }
    match array
        .values
        .iter()
        .position(|v| !v.is_finite() || v.abs() > 1e6)
    {
        Some(at) => Err(format!("`{key}`: number {at} is {}", array.values[at])),
        None => Ok(()),
    }
}

/// Our skeleton under SMPL's angles, its pelvis at `place`.
fn pose(angles: &[f64], place: [f64; 3]) -> Pose {
    let (angles, _) = angles.as_chunks::<3>();
    let mut points = [place; JOINT_COUNT];
    let mut turns = [IDENTITY; JOINT_COUNT];
    for joint in BodyJoint::ALL {
        let index = joint as usize;
        let turn = about(angles[index]);
        match joint.parent() {
            None => turns[index] = turn,
            Some(parent) => {
                let bone = unit_or(rest_direction(joint), [0.0, 1.0, 0.0]);
                let bone = scale(bone, BONE_LENGTH_M[index]);
                points[index] = add(
                    points[parent as usize],
                    apply(&turns[parent as usize], bone),
                );
                turns[index] = multiply(&turns[parent as usize], &turn);
            }
        }
    }
    points.map(narrow)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn golden(name: &str) -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("src/motion/golden")
            .join(name)
    }

    /// `golden/make.py` wrote it: two frames; in the second the left shoulder
    /// is turned by 90 degrees about z and the root stands 2 m to the left.
    #[test]
    fn angles_move_the_skeleton() {
        for file in ["aist.pkl", "aist_protocol2.pkl"] {
            let clip = read_aist(&golden(file)).unwrap();
            assert_eq!((clip.fps, clip.poses.len()), (60.0, 2), "{file}");
            let at = |frame: usize, joint: BodyJoint| clip.poses[frame][joint as usize];
            let arm = |frame, axis: usize| {
                at(frame, BodyJoint::LeftWrist)[axis] - at(frame, BodyJoint::LeftShoulder)[axis]
            };
            assert!(
                arm(0, 0) > 0.5 && arm(0, 1).abs() < 1e-4,
                "{file}: the T-pose"
            );
            assert!(
                arm(1, 1) > 0.5 && arm(1, 0).abs() < 1e-4,
                "{file}: the arm is up"
            );
            assert!((at(1, BodyJoint::Pelvis)[0] - 2.0).abs() < 1e-5);
        }
    }

    #[test]
    fn what_is_missing_is_named() {
        let message = read_aist(&golden("aist_empty.pkl"))
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("no array `smpl_poses`; the file has: other"),
            "{message}"
        );
    }
}
