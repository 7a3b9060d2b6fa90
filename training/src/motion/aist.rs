//! Reads AIST++ motion: SMPL joint angles in a pickle, 60 frames a second.
//! The angles move a plain skeleton: see [`super::smpl`].

use std::path::Path;

use super::pickle::arrays;
use super::smpl::pose;
use servodance_model::motion::vec3::scale;
use servodance_model::motion::{Clip, MotionError};

/// The ten genres: how names of clips begin, and the style.
pub const GENRES: [(&str, &str); 10] = [
    ("gBR", "break"),
    ("gPO", "pop"),
    ("gLO", "lock"),
    ("gMH", "middle-hip-hop"),
    ("gLH", "la-hip-hop"),
    ("gHO", "house"),
    ("gWA", "waack"),
    ("gKR", "krump"),
    ("gJS", "street-jazz"),
    ("gJB", "ballet-jazz"),
];

/// Frames a second of the data set.
const FPS: f64 = 60.0;
/// Angles a frame: 24 joints, three each.
const ANGLES: usize = 72;

/// Reads `smpl_poses`, `smpl_trans` and `smpl_scaling`.
pub fn read_aist(path: &Path) -> Result<Clip, MotionError> {
    let bytes = std::fs::read(path).map_err(|error| MotionError::read(path, error))?;
    let content = |reason: String| MotionError::content(path, reason);
    let arrays = arrays(&bytes).map_err(content)?;
    let get = |key: &str| {
        let mut names: Vec<_> = arrays.keys().map(String::as_str).collect();
        names.sort_unstable();
        arrays
            .get(key)
            .ok_or_else(|| content(format!("no array `{key}`; the file has: {}", names.join(", "))))
    };
    let (poses, places) = (get("smpl_poses")?, get("smpl_trans")?);
    let size = arrays.get("smpl_scaling").and_then(|array| array.values.first());
    let size = size.copied().unwrap_or(1.0);
    if !size.is_finite() || size.abs() < 1e-9 {
        return Err(content(format!("`smpl_scaling` is {size}")));
    }
    let poses = poses.rows::<ANGLES>("smpl_poses").map_err(content)?;
    let places = places.rows::<3>("smpl_trans").map_err(content)?;
    if poses.len() != places.len() {
        let (poses, places) = (poses.len(), places.len());
        return Err(content(format!("`smpl_poses` has {poses} frames, `smpl_trans` {places}")));
    }
    let poses = poses.iter().zip(places);
    let poses = poses.map(|(angles, place)| {
        let (angles, _) = angles.as_chunks::<3>();
        pose(angles, scale(*place, 1.0 / size))
    });
    Ok(Clip::of_file(path, FPS, poses.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_types::BodyJoint;

    fn golden(name: &str) -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("src/motion/golden").join(name)
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
            assert!(arm(0, 0) > 0.5 && arm(0, 1).abs() < 1e-4, "{file}: the T-pose");
            assert!(arm(1, 1) > 0.5 && arm(1, 0).abs() < 1e-4, "{file}: the arm is up");
            assert!((at(1, BodyJoint::Pelvis)[0] - 2.0).abs() < 1e-5);
        }
    }

    #[test]
    fn what_is_missing_is_named() {
        let message = read_aist(&golden("aist_empty.pkl")).unwrap_err().to_string();
        assert!(message.contains("no array `smpl_poses`; the file has: other"), "{message}");
    }
}
