//! A body from a few controls: feet on the floor, pelvis, spine, head, arms.
//!
//! Metres and radians. In the dancer's frame x is to the left, y up, z ahead.
//! Toes are placed, legs follow by inverse kinematics, and the pelvis sinks as
//! far as the legs can reach: a planted foot cannot slide.

use servodance_types::{BodyJoint, JOINT_COUNT};

use servodance_model::motion::Pose;
use servodance_model::motion::skeleton::{BONE_LENGTH_M, two_bone};
use servodance_model::motion::vec3::{Vec3, add, narrow, norm, scale, sub, turn, unit_or};

const TOE_HEIGHT_M: f64 = 0.018;
/// Height of an ankle joint over a flat foot's toe joint.
const ANKLE_RISE_M: f64 = 0.058;
const STANDING_M: f64 = 0.955;

/// One foot: the place of its toes, and how it is held there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FootPlacement {
    pub(crate) x: f64,
    pub(crate) z: f64,
    /// Where the toes point, from ahead to the left.
    pub(crate) yaw: f64,
    /// Above zero the heel is up, below zero the toes are.
    pub(crate) heel: f64,
    pub(crate) lift: f64,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyControls {
    /// The left foot, then the right one.
    pub(crate) feet: [FootPlacement; 2],
    /// Place of the pelvis over the floor: x, z.
    pub(crate) pelvis: [f64; 2],
    pub(crate) drop: f64,
    pub(crate) yaw: f64,
    pub(crate) torso: Torso,
    /// Upper arm and forearm, left and right, in the chest's frame; x points outwards.
    pub(crate) arms: [[Vec3; 2]; 2],
}

/// Angles of pelvis, spine and head: pitch is forwards, roll and twist are to the left.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Torso {
    pub(crate) pelvis: [f64; 3],
    pub(crate) spine: [f64; 3],
    pub(crate) head: [f64; 3],
    /// Shift of the pelvis against the feet: left, ahead.
    pub(crate) hips: [f64; 2],
    /// Lift of the left and right shoulder.
    pub(crate) shrug: [f64; 2],
}

impl Torso {
    pub(crate) fn to_array(self) -> [f64; 13] {
        let mut out = [0.0; 13];
        out[..3].copy_from_slice(&self.pelvis);
        out[3..6].copy_from_slice(&self.spine);
        out[6..9].copy_from_slice(&self.head);
        out[9..11].copy_from_slice(&self.hips);
        out[11..].copy_from_slice(&self.shrug);
        out
    }

    pub(crate) fn from_array(v: &[f64; 13]) -> Self {
        Self {
            pelvis: [v[0], v[1], v[2]],
            spine: [v[3], v[4], v[5]],
            head: [v[6], v[7], v[8]],
            hips: [v[9], v[10]],
            shrug: [v[11], v[12]],
        }
    }
}

/// Columns: where the x, y and z axes go.
type AxisColumns = [Vec3; 3];

fn rotation([pitch, roll, twist]: [f64; 3]) -> AxisColumns {
    let tilt = |v: Vec3| {
        let (s, c) = pitch.sin_cos();
        let v = [v[0], c * v[1] - s * v[2], s * v[1] + c * v[2]];
        let (s, c) = roll.sin_cos();
        let v = [c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]];
        turn(v, twist)
    };
    [tilt([1.0, 0.0, 0.0]), tilt([0.0, 1.0, 0.0]), tilt([0.0, 0.0, 1.0])]
}

fn rotate(r: &AxisColumns, v: Vec3) -> Vec3 {
    add(add(scale(r[0], v[0]), scale(r[1], v[1])), scale(r[2], v[2]))
}

fn chain(a: &AxisColumns, b: &AxisColumns) -> AxisColumns {
    b.map(|axis| rotate(a, axis))
}

/// The directions of the trunk's bones when the body stands upright.
fn upright(joint: BodyJoint) -> Vec3 {
    match joint {
        BodyJoint::LeftHip => [0.58, -0.80, -0.12],
        BodyJoint::RightHip => [-0.58, -0.80, -0.12],
        BodyJoint::Spine1 => [0.0, 0.96, -0.25],
        BodyJoint::Spine2 => [0.0, 0.99, 0.13],
        BodyJoint::Spine3 => [0.0, 1.0, 0.05],
        BodyJoint::Neck => [0.0, 0.985, -0.15],
        BodyJoint::LeftCollar => [0.57, 0.80, -0.15],
        BodyJoint::RightCollar => [-0.57, 0.80, -0.15],
        BodyJoint::Head => [0.0, 0.90, 0.43],
        BodyJoint::LeftShoulder => [0.93, 0.30, -0.15],
        BodyJoint::RightShoulder => [-0.93, 0.30, -0.15],
        _ => [0.0, -1.0, 0.0],
    }
}

fn bone(joint: BodyJoint, frame: &AxisColumns) -> Vec3 {
    let direction = unit_or(upright(joint), [0.0, 1.0, 0.0]);
    rotate(frame, scale(direction, BONE_LENGTH_M[joint as usize]))
}

pub(crate) fn pose(controls: &BodyControls) -> Pose {
    use BodyJoint::*;
    let torso = &controls.torso;
    let [pitch, roll, twist] = torso.pelvis;
    let facing = controls.yaw + twist;
    let pelvis_frame = rotation([pitch, roll, facing]);
    let spine_frame = |share: f64| chain(&pelvis_frame, &rotation(torso.spine.map(|a| a * share)));
    let chest = spine_frame(1.0);
    let shift = turn([torso.hips[0], 0.0, torso.hips[1]], controls.yaw);
    let ankles = controls.feet.map(|foot| ankle_and_toe(&foot));

    let mut at = [[0.0; 3]; JOINT_COUNT];
    at[Pelvis as usize] = [controls.pelvis[0] + shift[0], 0.0, controls.pelvis[1] + shift[2]];
    for (joint, frame) in [
        (LeftHip, pelvis_frame),
        (RightHip, pelvis_frame),
        (Spine1, pelvis_frame),
        (Spine2, spine_frame(0.35)),
        (Spine3, spine_frame(0.7)),
        (Neck, chest),
        (LeftCollar, chest),
        (RightCollar, chest),
        (Head, chain(&chest, &rotation(torso.head))),
    ] {
        let parent = joint.parent().unwrap_or(Pelvis);
        at[joint as usize] = add(at[parent as usize], bone(joint, &frame));
    }
    let height = pelvis_height(controls.drop, &at, &ankles);
    for point in &mut at {
        point[1] += height;
    }
    for (side, [hip, knee, ankle, toe]) in
        [[LeftHip, LeftKnee, LeftAnkle, LeftFoot], [RightHip, RightKnee, RightAnkle, RightFoot]]
            .into_iter()
            .enumerate()
    {
        let outwards = if side == 0 { 0.12 } else { -0.12 };
        let ahead = (controls.feet[side].yaw + facing) / 2.0 + outwards;
        let pole = turn([0.0, 0.0, 1.0], ahead);
        let lengths = [BONE_LENGTH_M[knee as usize], BONE_LENGTH_M[ankle as usize]];
        let [knee_at, ankle_at] = two_bone(at[hip as usize], ankles[side][0], pole, lengths);
        at[knee as usize] = knee_at;
        at[ankle as usize] = ankle_at;
        let foot = unit_or(sub(ankles[side][1], ankle_at), [0.0, 0.0, 1.0]);
        at[toe as usize] = add(ankle_at, scale(foot, BONE_LENGTH_M[toe as usize]));
    }
    for (side, [collar, shoulder, elbow, wrist]) in [
        [LeftCollar, LeftShoulder, LeftElbow, LeftWrist],
        [RightCollar, RightShoulder, RightElbow, RightWrist],
    ]
    .into_iter()
    .enumerate()
    {
        let [upper, fore] = controls.arms[side].map(|v| unit_or(v, [0.0, -1.0, 0.0]));
        let out = if side == 0 { 1.0 } else { -1.0 };
        // Raised arms take the shoulder with them.
        let raise = 0.35 * upper[1].max(0.0) + torso.shrug[side];
        let mut direction = upright(shoulder);
        direction[1] += raise;
        let length = BONE_LENGTH_M[shoulder as usize];
        let direction = unit_or(direction, [out, 0.0, 0.0]);
        let start = add(at[collar as usize], rotate(&chest, scale(direction, length)));
        at[shoulder as usize] = start;
        let limb = |direction: Vec3, joint: BodyJoint| {
            let direction = [direction[0] * out, direction[1], direction[2]];
            rotate(&chest, scale(direction, BONE_LENGTH_M[joint as usize]))
        };
        at[elbow as usize] = add(start, limb(upper, elbow));
        at[wrist as usize] = add(at[elbow as usize], limb(fore, wrist));
    }
    at.map(narrow)
}

/// Ankle, then toe; the toes carry the foot, so that a heel can rise without the foot moving.
fn ankle_and_toe(foot: &FootPlacement) -> [Vec3; 2] {
    let length = BONE_LENGTH_M[BodyJoint::LeftFoot as usize];
    let flat = (ANKLE_RISE_M / length).asin();
    // A foot in the air hangs.
    let angle = flat + foot.heel + (1.5 * foot.lift).min(0.6);
    let toes_up = if angle < flat { length * (flat.sin() - angle.sin()) } else { 0.0 };
    let toe = [foot.x, TOE_HEIGHT_M + foot.lift + toes_up, foot.z];
    let back = turn([0.0, angle.sin(), -angle.cos()], foot.yaw);
    [add(toe, scale(back, length)), toe]
}

/// As wished, or as low as the shorter reach of the two legs demands, softly between.
fn pelvis_height(drop: f64, at: &[Vec3; JOINT_COUNT], ankles: &[[Vec3; 2]; 2]) -> f64 {
    const SOFTNESS_M: f64 = 0.012;
    let mut heights = [STANDING_M - drop; 3];
    for (side, (hip, knee, ankle)) in [
        (BodyJoint::LeftHip, BodyJoint::LeftKnee, BodyJoint::LeftAnkle),
        (BodyJoint::RightHip, BodyJoint::RightKnee, BodyJoint::RightAnkle),
    ]
    .into_iter()
    .enumerate()
    {
        let leg = 0.993 * (BONE_LENGTH_M[knee as usize] + BONE_LENGTH_M[ankle as usize]);
        let hip = at[hip as usize];
        let target = ankles[side][0];
        let aside = norm([hip[0] - target[0], 0.0, hip[2] - target[2]]);
        let up = (leg * leg - aside * aside).max(0.04).sqrt();
        heights[side + 1] = target[1] + up - hip[1];
    }
    let lowest = heights.iter().copied().fold(f64::INFINITY, f64::min);
    let sum: f64 = heights.iter().map(|h| ((lowest - h) / SOFTNESS_M).exp()).sum();
    lowest - SOFTNESS_M * sum.ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_model::motion::skeleton::bone_length_m;

    fn standing() -> BodyControls {
        let foot = |x| FootPlacement { x, z: 0.1, ..FootPlacement::default() };
        BodyControls {
            feet: [foot(0.11), foot(-0.11)],
            pelvis: [0.0, 0.0],
            drop: 0.02,
            yaw: 0.0,
            torso: Torso::default(),
            arms: [[[0.2, -1.0, 0.0], [0.1, -0.9, 0.3]]; 2],
        }
    }

    #[test]
    fn bones_keep_their_length_in_any_pose() {
        let mut controls = standing();
        controls.yaw = 0.7;
        controls.torso.spine = [0.4, -0.3, 0.5];
        controls.feet[1] = FootPlacement { x: -0.6, z: 0.4, yaw: 0.3, heel: 0.5, lift: 0.2 };
        let pose = pose(&controls);
        for joint in BodyJoint::ALL {
            let error = bone_length_m(&pose, joint) - BONE_LENGTH_M[joint as usize];
            assert!(error.abs() < 1e-5, "{}: {error}", joint.name());
        }
    }

    #[test]
    fn planted_toes_stay_while_the_body_moves() {
        let mut moved = standing();
        moved.drop = 0.2;
        moved.torso.hips = [0.1, 0.0];
        moved.feet[0].heel = 0.6;
        let (a, b) = (pose(&standing()), pose(&moved));
        for toe in [BodyJoint::LeftFoot, BodyJoint::RightFoot] {
            for k in [0, 2] {
                assert!((a[toe as usize][k] - b[toe as usize][k]).abs() < 0.004);
            }
        }
    }
}
