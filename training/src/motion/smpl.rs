//! SMPL joint angles to points, and npz files of them: SMPL, SMPL-H and SMPL-X,
//! as in AMASS.
//!
//! **Approximate.** The angles move our own skeleton from a plain T-pose. SMPL's
//! rest joints depend on body shape and are model data under a licence of their
//! own; its thighs and arms rest some degrees off ours, so limbs are off by as
//! much. Body shape, fingers and face are left out.

use std::path::Path;

use servodance_types::{BodyJoint, JOINT_COUNT};

use super::named_skeleton::{lies_along_z, stand_up};
use servodance_model::motion::bvh_write::rest_direction;
use servodance_model::motion::numpy::Npz;
use servodance_model::motion::rotation::{IDENTITY, about, apply, multiply};
use servodance_model::motion::skeleton::BONE_LENGTH_M;
use servodance_model::motion::vec3::{Vec3, add, narrow, scale, unit_or};
use servodance_model::motion::{Clip, MotionError, Pose};

/// Angles of the joints that all these models share.
const BODY_ANGLES: usize = 3 * JOINT_COUNT;
const RATES: [&str; 4] = ["mocap_framerate", "mocap_frame_rate", "fps", "frame_rate"];

/// Reads `poses` [T, 72, 156 or 165], `trans` [T, 3] and the frame rate.
pub fn read_smpl(path: &Path) -> Result<Clip, MotionError> {
    let content = |reason: String| MotionError::content(path, reason);
    let mut npz = Npz::open(path)?;
    let (angles, places) = (npz.need("poses")?, npz.need("trans")?);
    let fps = RATES.iter().find_map(|key| npz.get(key).transpose());
    let fps = fps.ok_or_else(|| {
        let names = npz.names();
        content(format!("no frame rate ({}); the file has {names:?}", RATES.join(", ")))
    })??;
    let fps = fps.values.first().copied().unwrap_or(0.0);
    if !(1.0..=1000.0).contains(&fps) {
        return Err(content(format!("a frame rate of {fps}, expected 1 to 1000")));
    }
    let angles = match angles.shape[..] {
        [_, 72] => body(angles.rows::<72>("poses")),
        [_, 156] => body(angles.rows::<156>("poses")),
        [_, 165] => body(angles.rows::<165>("poses")),
        _ => Err(format!(
            "`poses` is {:?}, expected 72 (SMPL), 156 (SMPL-H) or 165 (SMPL-X) numbers a frame",
            angles.shape
        )),
    };
    let angles = angles.map_err(content)?;
    let places = places.rows::<3>("trans").map_err(content)?;
    if angles.len() != places.len() {
        let (angles, places) = (angles.len(), places.len());
        return Err(content(format!("`poses` has {angles} frames, `trans` {places}")));
    }
    let mut poses: Vec<Pose> =
        angles.iter().zip(places).map(|(angles, place)| pose(angles, *place)).collect();
    if lies_along_z(&poses) {
        stand_up(&mut poses);
    }
    Ok(Clip::of_file(path, fps, poses))
}

type BodyAngles = [Vec3; JOINT_COUNT];

fn body<const N: usize>(rows: Result<&[[f64; N]], String>) -> Result<Vec<BodyAngles>, String> {
    let of_body = |row: &[f64; N]| std::array::from_fn(|j| std::array::from_fn(|k| row[3 * j + k]));
    const { assert!(N >= BODY_ANGLES) };
    Ok(rows?.iter().map(of_body).collect())
}

/// Our skeleton under at least the angles of the body, joint by joint, its pelvis at `place`.
pub(super) fn pose(angles: &[Vec3], place: Vec3) -> Pose {
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
                points[index] = add(points[parent as usize], apply(&turns[parent as usize], bone));
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
        Path::new(env!("CARGO_MANIFEST_DIR")).join("src/motion/golden").join(name)
    }

    /// `golden/make.py` wrote it: z up, 120 frames a second, the body upright,
    /// in the second frame its left elbow bent by 90 degrees.
    #[test]
    fn a_file_with_z_up_stands_with_y_up() {
        let clip = read_smpl(&golden("smplh.npz")).unwrap();
        assert_eq!((clip.fps, clip.poses.len()), (120.0, 2));
        let at = |frame: usize, joint: BodyJoint| clip.poses[frame][joint as usize];
        assert!(at(0, BodyJoint::Head)[1] > at(0, BodyJoint::LeftAnkle)[1] + 1.2);
        let forearm = |frame, axis: usize| {
            at(frame, BodyJoint::LeftWrist)[axis] - at(frame, BodyJoint::LeftElbow)[axis]
        };
        assert!(forearm(0, 0).abs() > 0.25 && forearm(1, 0).abs() < 1e-3);
    }

    #[test]
    fn another_number_of_joints_is_refused() {
        let message = read_smpl(&golden("smpl_wide.npz")).unwrap_err().to_string();
        assert!(message.contains("[2, 99], expected 72 (SMPL)"), "{message}");
    }
}
