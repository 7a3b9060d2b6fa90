//! One skeleton for all motion: fixed bone lengths, feet kept where they were.
//!
//! The lengths are those of the HumanML3D target skeleton, so that motion
//! encoded here and there has the same proportions. Units: metres.

use servodance_types::{BodyJoint, JOINT_COUNT};

use super::Pose;
use super::vec3::{Vec3, add, cross, dot, lerp, narrow, norm, scale, sub, unit_or, wide};

/// Distance of every joint from its parent, metres (HumanML3D's target
/// skeleton); zero for the pelvis.
pub const BONE_LENGTH_M: [f64; JOINT_COUNT] = [
    0.0, 0.1031, 0.1099, 0.1316, 0.3936, 0.3902, 0.1432, 0.4324, 0.4256, 0.0574, 0.1434, 0.1494,
    0.2194, 0.1375, 0.1434, 0.1030, 0.1316, 0.1230, 0.2568, 0.2631, 0.2660, 0.2699,
];

/// Hip, knee, ankle and toe of both legs.
const LEGS: [[BodyJoint; 4]; 2] = [
    [BodyJoint::LeftHip, BodyJoint::LeftKnee, BodyJoint::LeftAnkle, BodyJoint::LeftFoot],
    [BodyJoint::RightHip, BodyJoint::RightKnee, BodyJoint::RightAnkle, BodyJoint::RightFoot],
];

/// The distance between a joint and its parent in `pose`, metres.
pub fn bone_length_m(pose: &Pose, joint: BodyJoint) -> f64 {
    match joint.parent() {
        Some(parent) => norm(sub(wide(pose[joint as usize]), wide(pose[parent as usize]))),
        None => 0.0,
    }
}

/// The mirror image: left and right exchanged, x turned round.
pub fn mirrored(pose: &Pose) -> Pose {
    BodyJoint::ALL.map(|joint| {
        let [x, y, z] = pose[joint.mirrored() as usize];
        [-x, y, z]
    })
}

/// Target leg length over the mean leg length of `poses`: what the path of
/// the root is scaled by. 1 where there is no leg to measure.
pub fn leg_scale(poses: &[Pose]) -> f64 {
    let bones = LEGS.iter().flat_map(|leg| [leg[1], leg[2]]);
    let (mut source, mut target) = (0.0, 0.0);
    for joint in bones {
        target += BONE_LENGTH_M[joint as usize] * poses.len() as f64;
        source += poses.iter().map(|pose| bone_length_m(pose, joint)).sum::<f64>();
    }
    if source > 1e-6 { target / source } else { 1.0 }
}

/// `pose` on the common skeleton, its size multiplied by `size`.
///
/// The middle of the hips and both ankles go to `size` times their old place,
/// so that a foot that stood still stands still; knees follow by two-bone
/// inverse kinematics in their old plane; every other bone keeps its direction.
pub fn fit(pose: &Pose, size: f64) -> Pose {
    let source = pose.map(wide);
    let mut out = [[0.0; 3]; JOINT_COUNT];
    for joint in BodyJoint::ALL {
        if let Some(parent) = joint.parent() {
            let bone = sub(source[joint as usize], source[parent as usize]);
            let direction = unit_or(bone, [0.0, -1.0, 0.0]);
            let bone = scale(direction, BONE_LENGTH_M[joint as usize]);
            out[joint as usize] = add(out[parent as usize], bone);
        }
    }
    let hips_middle =
        |p: &[Vec3]| lerp(p[BodyJoint::LeftHip as usize], p[BodyJoint::RightHip as usize], 0.5);
    let shift = sub(scale(hips_middle(&source), size), hips_middle(&out));
    for point in &mut out {
        *point = add(*point, shift);
    }
    for [hip, knee, ankle, foot] in LEGS.map(|leg| leg.map(|joint| joint as usize)) {
        let toe = sub(out[foot], out[ankle]);
        let pole =
            sub(source[knee], lerp(source[hip], source[ankle], bend_share(&source, hip, knee)));
        let target = scale(source[ankle], size);
        let lengths = [BONE_LENGTH_M[knee], BONE_LENGTH_M[ankle]];
        [out[knee], out[ankle]] = two_bone(out[hip], target, pole, lengths);
        out[foot] = add(out[ankle], toe);
    }
    out.map(narrow)
}

/// Where on the straight line hip-ankle the thigh's share of the leg ends.
fn bend_share(source: &[Vec3], hip: usize, knee: usize) -> f64 {
    let ankle = knee + 3;
    let thigh = norm(sub(source[knee], source[hip]));
    let shank = norm(sub(source[ankle], source[knee]));
    thigh / (thigh + shank).max(1e-9)
}

/// The two joints of a limb that starts at `root`, bends towards `pole` and
/// reaches for `target` (as far as it can): middle joint and end.
pub fn two_bone(root: Vec3, target: Vec3, pole: Vec3, lengths: [f64; 2]) -> [Vec3; 2] {
    let [upper, lower] = lengths;
    let axis = unit_or(sub(target, root), [0.0, -1.0, 0.0]);
    let longest = (upper + lower) * 0.9999;
    let shortest = (upper - lower).abs() * 1.0001 + 1e-6;
    let reach = norm(sub(target, root)).clamp(shortest, longest);
    let along = (upper * upper - lower * lower + reach * reach) / (2.0 * reach);
    let aside = (upper * upper - along * along).max(0.0).sqrt();
    let pole = sub(pole, scale(axis, dot(pole, axis)));
    let bend = unit_or(pole, unit_or(cross([1.0, 0.0, 0.0], axis), [0.0, 0.0, 1.0]));
    let middle = add(root, add(scale(axis, along), scale(bend, aside)));
    [middle, add(root, scale(axis, reach))]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crouch() -> Pose {
        let mut pose = [[0.0; 3]; JOINT_COUNT];
        for joint in BodyJoint::ALL {
            let j = joint as usize;
            if let Some(parent) = joint.parent() {
                let wobble = (j as f32 * 1.7).sin() * 0.1;
                let down = if LEGS.iter().flatten().any(|leg| *leg == joint) { -0.3 } else { 0.2 };
                let side = if joint.name().starts_with("left") { 0.08 } else { -0.08 };
                let p = pose[parent as usize];
                pose[j] = [p[0] + side, p[1] + down, p[2] + wobble];
            }
        }
        pose
    }

    #[test]
    fn fit_gives_every_bone_its_length() {
        let fitted = fit(&crouch(), 1.0);
        for joint in BodyJoint::ALL {
            let error = bone_length_m(&fitted, joint) - BONE_LENGTH_M[joint as usize];
            assert!(error.abs() < 1e-5, "{} is off by {error} m", joint.name());
        }
    }

    #[test]
    fn fit_keeps_the_ankles_in_place() {
        let pose = crouch();
        let fitted = fit(&pose, 1.1);
        for ankle in [BodyJoint::LeftAnkle, BodyJoint::RightAnkle] {
            let wanted = scale(wide(pose[ankle as usize]), 1.1);
            assert!(norm(sub(wide(fitted[ankle as usize]), wanted)) < 1e-5);
        }
    }

    #[test]
    fn two_bone_reaches_and_bends_towards_the_pole() {
        let [knee, ankle] = two_bone([0.0; 3], [0.0, -0.6, 0.0], [0.0, 0.0, 1.0], [0.4, 0.4]);
        assert!(norm(sub(ankle, [0.0, -0.6, 0.0])) < 1e-9);
        assert!(knee[2] > 0.2 && (norm(knee) - 0.4).abs() < 1e-9);
    }
}
