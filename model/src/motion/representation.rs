//! Positions to the 137 numbers a frame that the networks see, and back.
//!
//! HumanML3D's 263-d vector without its rotations:
//!
//! | slice | what |
//! |---|---|
//! | `[0]` | root yaw step to the next frame, half angle, radians (its sign) |
//! | `[1..3]` | root x, z step to the next frame, in the next frame's heading, metres |
//! | `[3]` | root height, metres |
//! | `[4..67]` | 21 joints: x, z relative to the root, heading removed; y above the floor |
//! | `[67..133]` | 22 joint steps to the next frame, in the current heading, metres |
//! | `[133..137]` | contact of left ankle, left foot, right ankle, right foot |
//!
//! T frames give T-1 vectors: the last frame has no next. One departure: the
//! heading is smoothed in time (it must be integrated, so twisting shoulders
//! should not enter it); recovery is exact whatever heading was chosen.

use std::f64::consts::{PI, TAU};

use servodance_types::{BodyJoint, Contacts, JOINT_COUNT};

use super::Pose;
use super::vec3::{Vec3, add, narrow, sub, turn, wide};

/// Numbers of one frame in the form that the networks see.
pub const POSE_DIM: usize = 137;
/// Where the 21 joint positions begin.
pub const JOINTS_AT: usize = 4;
/// Where the 22 joint steps begin.
pub const STEPS_AT: usize = JOINTS_AT + 3 * (JOINT_COUNT - 1);
/// Where the four contacts begin.
pub const CONTACTS_AT: usize = STEPS_AT + 3 * JOINT_COUNT;

/// One frame as the networks see it (not normalised).
pub type PoseVector = [f32; POSE_DIM];

/// A foot joint is in contact while its squared step stays below this (m^2).
const CONTACT_STEP_M2: f64 = 0.002;
/// Standard deviation of the heading's smoothing, frames (0.2 s).
const HEADING_SIGMA_FRAMES: f64 = 4.0;
/// The foot joints, in the order of the contacts.
const FEET: [BodyJoint; 4] =
    [BodyJoint::LeftAnkle, BodyJoint::LeftFoot, BodyJoint::RightAnkle, BodyJoint::RightFoot];

/// Where the body faces: angle from +z towards +x, radians, from the hips and
/// shoulders; 0 when they give no direction.
pub fn heading_rad(pose: &Pose) -> f64 {
    let at = |joint: BodyJoint| wide(pose[joint as usize]);
    let hips = sub(at(BodyJoint::LeftHip), at(BodyJoint::RightHip));
    let shoulders = sub(at(BodyJoint::LeftShoulder), at(BodyJoint::RightShoulder));
    let left = add(hips, shoulders);
    // forward = left x up
    let forward = [-left[2], left[0]];
    if forward[0].hypot(forward[1]) < 1e-9 {
        return 0.0;
    }
    forward[0].atan2(forward[1])
}

/// The smoothed heading of every frame, radians, continuous over full turns.
pub fn headings_rad(poses: &[Pose]) -> Vec<f64> {
    let mut raw: Vec<f64> = poses.iter().map(heading_rad).collect();
    for i in 1..raw.len() {
        raw[i] = raw[i - 1] + (raw[i] - raw[i - 1] + PI).rem_euclid(TAU) - PI;
    }
    let reach = (3.0 * HEADING_SIGMA_FRAMES) as isize;
    let last = raw.len() as isize - 1;
    (0..raw.len() as isize)
        .map(|i| {
            let (mut sum, mut total) = (0.0, 0.0);
            for offset in -reach..=reach {
                let weight = (-0.5 * (offset as f64 / HEADING_SIGMA_FRAMES).powi(2)).exp();
                sum += weight * raw[(i + offset).clamp(0, last) as usize];
                total += weight;
            }
            sum / total
        })
        .collect()
}

/// The vectors of a motion: one fewer than `poses`, none below two poses.
///
/// Only heights are taken as they are, so the floor must be at y = 0; where
/// the motion starts and faces does not matter.
pub fn encode(poses: &[Pose]) -> Vec<PoseVector> {
    let headings = headings_rad(poses);
    poses
        .windows(2)
        .zip(headings.windows(2))
        .map(|(pair, heading)| encode_step(&pair[0], &pair[1], heading[0], heading[1]))
        .collect()
}

/// The numbers of one frame from its pose, the next one, and
/// their headings in radians.
pub fn encode_step(now: &Pose, next: &Pose, heading: f64, next_heading: f64) -> PoseVector {
    let mut out = [0.0; POSE_DIM];
    let (now, next) = (now.map(wide), next.map(wide));
    let root_step = turn(sub(next[0], now[0]), -next_heading);
    out[0] = (-(next_heading - heading) / 2.0) as f32;
    out[1] = root_step[0] as f32;
    out[2] = root_step[2] as f32;
    out[3] = now[0][1] as f32;
    let floor_under_root = [now[0][0], 0.0, now[0][2]];
    for (j, (here, there)) in now.into_iter().zip(next).enumerate() {
        if j > 0 {
            let local = turn(sub(here, floor_under_root), -heading);
            put(&mut out, JOINTS_AT + 3 * (j - 1), local);
        }
        put(&mut out, STEPS_AT + 3 * j, turn(sub(there, here), -heading));
    }
    for (k, joint) in FEET.into_iter().enumerate() {
        let step = sub(next[joint as usize], now[joint as usize]);
        let squared: f64 = step.iter().map(|x| x * x).sum();
        out[CONTACTS_AT + k] = if squared < CONTACT_STEP_M2 { 1.0 } else { 0.0 };
    }
    out
}

fn put(out: &mut PoseVector, at: usize, v: Vec3) {
    out[at..at + 3].copy_from_slice(&narrow(v));
}

/// All poses of `vectors`, from the origin, facing +z.
pub fn decode(vectors: &[PoseVector]) -> Vec<Pose> {
    let mut recovery = Recovery::default();
    vectors.iter().map(|v| recovery.push(v)).collect()
}

/// Vectors back to world positions, one frame at a time: constant memory, no
/// allocation. Starts at the origin, facing +z.
#[derive(Clone, Debug, Default)]
pub struct Recovery {
    heading_rad: f64,
    root_xz_m: [f64; 2],
    /// The last vector's yaw step and root step: they move the next frame.
    pending: [f64; 3],
}

impl Recovery {
    /// Goes on from another place: the last frame is taken to have stood at
    /// `root_xz_m`, facing `heading_rad`; its step to the next one stays.
    pub fn move_to(&mut self, root_xz_m: [f64; 2], heading_rad: f64) {
        self.root_xz_m = root_xz_m;
        self.heading_rad = heading_rad;
    }

    /// The world positions of the next frame. Numbers that are not finite come
    /// out as they went in: refuse them where they are made.
    pub fn push(&mut self, vector: &PoseVector) -> Pose {
        let [yaw_half, x, z] = self.pending;
        self.heading_rad = (self.heading_rad - 2.0 * yaw_half).rem_euclid(TAU);
        let step = turn([x, 0.0, z], self.heading_rad);
        self.root_xz_m = [self.root_xz_m[0] + step[0], self.root_xz_m[1] + step[2]];
        self.pending = [vector[0], vector[1], vector[2]].map(f64::from);

        let [root_x, root_z] = self.root_xz_m;
        let mut out = [[0.0; 3]; JOINT_COUNT];
        out[0] = narrow([root_x, f64::from(vector[3]), root_z]);
        for (j, point) in out.iter_mut().enumerate().skip(1) {
            let at = JOINTS_AT + 3 * (j - 1);
            let local = [vector[at], vector[at + 1], vector[at + 2]].map(f64::from);
            *point = narrow(add(turn(local, self.heading_rad), [root_x, 0.0, root_z]));
        }
        out
    }

    /// Where the last frame faces, radians from +z towards +x.
    pub fn heading_rad(&self) -> f64 {
        self.heading_rad
    }
}

/// The contacts that a vector claims: a foot is down when its ankle or toe is.
pub fn contacts(vector: &PoseVector) -> Contacts {
    let down = |k: usize| vector[CONTACTS_AT + k] > 0.5;
    Contacts { left: down(0) || down(1), right: down(2) || down(3) }
}

/// The vector of the same motion seen in a mirror (left becomes right).
pub fn mirrored(vector: &PoseVector) -> PoseVector {
    let mut out = *vector;
    out[0] = -vector[0];
    out[1] = -vector[1];
    for joint in BodyJoint::ALL {
        let (from, to) = (joint.mirrored() as usize, joint as usize);
        let mut flip = |from: usize, to: usize| {
            let [x, y, z] = [vector[from], vector[from + 1], vector[from + 2]];
            out[to..to + 3].copy_from_slice(&[-x, y, z]);
        };
        if to > 0 {
            flip(JOINTS_AT + 3 * (from - 1), JOINTS_AT + 3 * (to - 1));
        }
        flip(STEPS_AT + 3 * from, STEPS_AT + 3 * to);
    }
    for k in 0..4 {
        out[CONTACTS_AT + k] = vector[CONTACTS_AT + (k + 2) % 4];
    }
    out
}

#[cfg(all(test, feature = "motion-files"))]
mod tests {
    use super::super::skeleton;
    use super::*;

    /// A body that walks, turns on the spot and bobs.
    fn motion() -> Vec<Pose> {
        let body: Pose = std::array::from_fn(|j| {
            let name = BodyJoint::ALL[j].name();
            let side = match name.split_once('_') {
                Some(("left", _)) => 0.15,
                Some(("right", _)) => -0.15,
                _ => 0.0,
            };
            [side, 0.9 - 0.04 * j as f32, 0.01 * j as f32]
        });
        (0..60)
            .map(|i| {
                let t = f64::from(i) / 20.0;
                let yaw = 4.0 * t + 0.3 * (9.0 * t).sin();
                body.map(|p| {
                    let p = turn(wide(p), yaw);
                    narrow(add(p, [t.sin(), 0.1 * (7.0 * t).cos(), 0.5 * t * t]))
                })
            })
            .collect()
    }

    fn placed(poses: &[Pose]) -> Vec<Pose> {
        let heading = headings_rad(poses)[0];
        let [x, _, z] = wide(poses[0][0]);
        poses
            .iter()
            .map(|pose| pose.map(|p| narrow(turn(sub(wide(p), [x, 0.0, z]), -heading))))
            .collect()
    }

    fn largest_gap_m(a: &[Pose], b: &[Pose]) -> f32 {
        let gaps = a.iter().flatten().flatten().zip(b.iter().flatten().flatten());
        gaps.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn recovery_returns_the_positions() {
        let poses = motion();
        let recovered = decode(&encode(&poses));
        assert_eq!(recovered.len(), poses.len() - 1);
        assert!(largest_gap_m(&recovered, &placed(&poses)) < 2e-6);
    }

    #[test]
    fn recovered_motion_starts_at_the_origin_facing_z() {
        let mut recovery = Recovery::default();
        let first = recovery.push(&encode(&motion())[0]);
        assert_eq!((first[0][0], first[0][2]), (0.0, 0.0));
        assert_eq!(recovery.heading_rad(), 0.0);
    }

    #[test]
    fn a_turn_to_the_left_is_a_negative_half_angle() {
        // HumanML3D rotates the face direction onto +z: turning the body
        // towards +x turns that rotation back.
        let vectors = encode(&motion());
        let mean: f32 = vectors[20..40].iter().map(|v| v[0]).sum::<f32>() / 20.0;
        assert!((mean + 0.1).abs() < 0.01, "mean half step {mean}");
    }

    #[test]
    fn mirrored_vectors_are_the_mirrored_motion() {
        let walk = motion();
        let expected = encode(&walk.iter().map(skeleton::mirrored).collect::<Vec<_>>());
        let actual = encode(&walk).iter().map(mirrored).collect::<Vec<_>>();
        for (a, e) in actual.iter().zip(&expected) {
            for (k, (a, e)) in a.iter().zip(e).enumerate() {
                assert!((a - e).abs() < 1e-5, "number {k}: {a} is not {e}");
            }
        }
    }

    #[test]
    fn contacts_follow_the_step_of_each_foot() {
        let mut poses = vec![[[0.0, 1.0, 0.0]; JOINT_COUNT]; 2];
        poses[1][BodyJoint::LeftAnkle as usize][0] = 0.05;
        poses[1][BodyJoint::RightFoot as usize][0] = 0.04;
        let v = encode(&poses)[0];
        assert_eq!(v[CONTACTS_AT..], [0.0, 1.0, 1.0, 1.0]);
    }
}
