//! HumanML3D's 263 numbers a frame, for programs that read and score them.
//!
//! | slice | what |
//! |---|---|
//! | `[0..67]` | yaw step, root step, root height, 21 positions: as in [`servodance_model::motion::representation`] |
//! | `[67..193]` | 21 rotations: the first two columns of each matrix |
//! | `[193..263]` | 22 joint steps, four contacts: as in [`servodance_model::motion::representation`] |
//!
//! The heading is HumanML3D's own: smoothed over a second, the hips subtracted
//! from the shoulders (their face joints arrive in another order than they are
//! read), and 0 in the first frame. A rotation is the shortest from a joint's
//! rest direction to its bone, seen from the joint before it in the chain; both
//! arms start from the root. `golden/humanml.py` is an independent implementation.
//!
//! T frames give T-1 vectors. Heights are taken as they are: put the motion on
//! the floor first ([`servodance_model::motion::Clip::normalised`]).

use std::path::Path;

use servodance_types::BodyJoint::{self, *};
use servodance_types::{FRAME_RATE_HZ, JOINT_COUNT};

use servodance_model::motion::numpy::{Array, read_npy};
use servodance_model::motion::representation::{
    POSE_DIM, PoseVector, STEPS_AT, decode, encode_step, heading_rad,
};
use servodance_model::motion::rotation::{Matrix, between, multiply, transposed};
use servodance_model::motion::vec3::{Vec3, add, narrow, sub, turn, wide};
use servodance_model::motion::{Clip, MotionError, Pose};

pub const HUMANML_DIM: usize = 263;
/// Numbers of the 21 rotations; they begin where our own joint steps do.
const ROTATIONS: usize = 6 * (JOINT_COUNT - 1);
const SMOOTHING: (f64, isize) = (20.0, 80);
/// The joints of each limb in order; the arms begin at the chest.
const CHAINS: [&[BodyJoint]; 5] = [
    &[Pelvis, RightHip, RightKnee, RightAnkle, RightFoot],
    &[Pelvis, LeftHip, LeftKnee, LeftAnkle, LeftFoot],
    &[Pelvis, Spine1, Spine2, Spine3, Neck, Head],
    &[Spine3, RightCollar, RightShoulder, RightElbow, RightWrist],
    &[Spine3, LeftCollar, LeftShoulder, LeftElbow, LeftWrist],
];

pub type HumanMlVector = [f32; HUMANML_DIM];

fn rest(joint: BodyJoint) -> Vec3 {
    match joint {
        LeftHip | LeftCollar => [1.0, 0.0, 0.0],
        RightHip | RightCollar => [-1.0, 0.0, 0.0],
        Spine1 | Spine2 | Spine3 | Neck => [0.0, 1.0, 0.0],
        LeftFoot | RightFoot | Head => [0.0, 0.0, 1.0],
        _ => [0.0, -1.0, 0.0],
    }
}

/// The vectors of a motion: one fewer than `poses`, none below two poses.
pub fn encode(poses: &[Pose]) -> Vec<HumanMlVector> {
    let headings = headings_rad(poses);
    let first = headings.first().copied().unwrap_or(0.0);
    poses
        .windows(2)
        .zip(headings.windows(2))
        .map(|(pair, heading)| {
            let ours = encode_step(&pair[0], &pair[1], heading[0], heading[1]);
            let rotations = rotations(&pair[0], first, heading[0]);
            let mut out = [0.0; HUMANML_DIM];
            out[..STEPS_AT].copy_from_slice(&ours[..STEPS_AT]);
            out[STEPS_AT..STEPS_AT + ROTATIONS].copy_from_slice(rotations.as_flattened());
            out[STEPS_AT + ROTATIONS..].copy_from_slice(&ours[STEPS_AT..]);
            out
        })
        .collect()
}

/// All poses of `vectors`, from the origin, facing +z; the rotations are not used.
pub fn recover(vectors: &[HumanMlVector]) -> Vec<Pose> {
    let ours: Vec<PoseVector> = vectors
        .iter()
        .map(|vector| {
            let mut out = [0.0; POSE_DIM];
            out[..STEPS_AT].copy_from_slice(&vector[..STEPS_AT]);
            out[STEPS_AT..].copy_from_slice(&vector[STEPS_AT + ROTATIONS..]);
            out
        })
        .collect();
    decode(&ours)
}

/// HumanML3D's headings, from +z towards +x, radians.
fn headings_rad(poses: &[Pose]) -> Vec<f64> {
    let last = poses.len() as isize - 1;
    let forward: Vec<[f64; 2]> = poses.iter().map(forward).collect();
    let (sigma, reach) = SMOOTHING;
    let mut out: Vec<f64> = (0..=last)
        .map(|i| {
            let (mut x, mut z) = (0.0, 0.0);
            for offset in -reach..=reach {
                let weight = (-0.5 * (offset as f64 / sigma).powi(2)).exp();
                let at = forward[(i + offset).clamp(0, last) as usize];
                x += weight * at[0];
                z += weight * at[1];
            }
            x.atan2(z)
        })
        .collect();
    if let Some(first) = out.first_mut() {
        *first = heading_rad(&poses[0]);
    }
    out
}

/// Where shoulders less hips face, on the floor (x, z).
fn forward(pose: &Pose) -> [f64; 2] {
    let at = |joint: BodyJoint| wide(pose[joint as usize]);
    let shoulders = sub(at(RightShoulder), at(LeftShoulder));
    let across = add(shoulders, sub(at(LeftHip), at(RightHip)));
    let length = servodance_model::motion::vec3::norm(across).max(1e-9);
    // up x across
    [across[2] / length, -across[0] / length]
}

/// Rotations of joints 1 to 21 in a frame of heading `heading_rad`, in a motion from `first_rad`.
fn rotations(pose: &Pose, first_rad: f64, heading_rad: f64) -> [[f32; 6]; JOINT_COUNT - 1] {
    let points = pose.map(|point| turn(wide(point), -first_rad));
    let back = first_rad - heading_rad;
    let root = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| turn(axis, back));
    let root = transposed(&root); // columns are where the axes go
    let mut out = [[0.0; 6]; JOINT_COUNT - 1];
    for chain in CHAINS {
        let mut before: Matrix = root;
        for pair in chain.windows(2) {
            let [from, to] = [pair[0] as usize, pair[1] as usize];
            let bone = sub(points[to], points[from]);
            let now = between(rest(pair[1]), bone);
            let [x, y, _] = transposed(&multiply(&transposed(&before), &now)).map(narrow);
            out[to - 1] = [x[0], x[1], x[2], y[0], y[1], y[2]];
            before = now;
        }
    }
    out
}

/// `new_joint_vecs` ([T, 263]) or `new_joints` ([T, 22, 3]), 20 frames a second.
pub fn read_vectors(path: &Path) -> Result<Vec<HumanMlVector>, MotionError> {
    vectors(&read_npy(path)?).map_err(|reason| MotionError::content(path, reason))
}

fn vectors(array: &Array) -> Result<Vec<HumanMlVector>, String> {
    let rows = array.rows::<HUMANML_DIM>("vectors")?;
    Ok(rows.iter().map(|row| row.map(|v| v as f32)).collect())
}

/// Reads `new_joint_vecs` ([T, 263]) or `new_joints` ([T, 22, 3]) from a
/// `.npy` file, 20 frames a second.
pub fn read_humanml(path: &Path) -> Result<Clip, MotionError> {
    let content = |reason: String| MotionError::content(path, reason);
    let array = read_npy(path)?;
    let poses = match array.shape[..] {
        [_, HUMANML_DIM] => recover(&vectors(&array).map_err(content)?),
        [_, JOINT_COUNT, 3] => {
            let rows = array.rows::<{ 3 * JOINT_COUNT }>("joints").map_err(content)?;
            let pose = |row: &[f64; 3 * JOINT_COUNT]| -> Pose {
                std::array::from_fn(|j| std::array::from_fn(|k| row[3 * j + k] as f32))
            };
            rows.iter().map(pose).collect()
        }
        _ => {
            let shape = &array.shape;
            return Err(content(format!(
                "{shape:?} numbers, expected [frames, 263] (new_joint_vecs) or [frames, 22, 3] (new_joints)"
            )));
        }
    };
    Ok(Clip::of_file(path, FRAME_RATE_HZ, poses))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::choreography::{DanceBeat, DanceStyle, choreograph};

    /// Every joint on its own circle about a body that turns; `golden/humanml.py`
    /// has the same formula.
    fn circling() -> Vec<Pose> {
        let pose = |i: usize| -> Pose {
            std::array::from_fn(|j| {
                let (t, joint) = (i as f64 / 20.0, j as f64);
                let side = match BodyJoint::ALL[j].name().split_once('_') {
                    Some(("left", _)) => 0.02 * (joint + 10.0),
                    Some(("right", _)) => -0.02 * (joint + 10.0),
                    _ => 0.0,
                };
                let local = [
                    side + 0.05 * (2.0 * t + joint).sin(),
                    1.0 + 0.5 * (1.7 * joint).sin() + 0.05 * (3.0 * t + 2.0 * joint).cos(),
                    0.1 * (4.0 * t + 0.5 * joint).cos() + 0.1 * (2.3 * joint).sin(),
                ];
                narrow(add(turn(local, 0.7 + 0.8 * t), [0.3 * t, 0.0, 0.2 * (2.0 * t).sin()]))
            })
        };
        (0..50).map(pose).collect()
    }

    // Made by golden/humanml.py: numbers 0-9 and 67-78 of frames 0 and 30, and
    // the sum of all numbers, each times the sine of its place plus one.
    include!("golden/humanml.in");

    #[test]
    fn vectors_match_the_independent_script() {
        let vectors = encode(&circling());
        assert_eq!(vectors.len(), 49);
        for (frame, golden) in [(0, GOLDEN_FIRST), (30, GOLDEN_THIRTIETH)] {
            let found = vectors[frame][..10].iter().chain(&vectors[frame][67..79]);
            for (k, (found, golden)) in found.zip(golden).enumerate() {
                let error = (f64::from(*found) - golden).abs();
                assert!(error < 2e-6, "frame {frame}, {k}: {found} is not {golden}");
            }
        }
        let numbers = vectors.as_flattened().iter().enumerate();
        let sum: f64 = numbers.map(|(k, v)| f64::from(*v) * (1.0 + (k as f64).sin())).sum();
        assert!((sum - GOLDEN_SUM).abs() < 2e-3, "{sum} is not {GOLDEN_SUM}");
    }

    #[test]
    fn recovery_returns_the_positions() {
        let beats: Vec<DanceBeat> = (0..10)
            .map(|i| DanceBeat { time_s: 0.5 * f64::from(i), downbeat: i % 4 == 0 })
            .collect();
        let poses = choreograph(&beats, 5.0, DanceStyle::Groove, 3).normalised().poses;
        // Normalised motion faces +z by our heading: turn it by theirs.
        let heading = heading_rad(&poses[0]);
        let placed = |p: [f32; 3]| narrow(turn(wide(p), -heading));
        let back = recover(&encode(&poses));
        for (a, b) in poses.iter().flatten().zip(back.iter().flatten()) {
            let a = placed(*a);
            assert!((0..3).all(|k| (a[k] - b[k]).abs() < 2e-5), "{a:?} {b:?}");
        }
    }
}
