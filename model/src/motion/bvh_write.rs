//! A clip as a BVH file: the format that animation programs read.
//!
//! One skeleton with the clip's mean bone lengths, T-pose, y up, facing +z,
//! metres (the root has three positions), Euler angles Z X Y in degrees. The
//! clip knows positions only, so the twist about a bone is not known: each
//! joint takes the shortest turn from its rest direction. Where a joint has
//! several children (pelvis, chest) they are turned together as well as a rigid
//! body can; elsewhere joint positions come back to a millimetre.

use std::fmt::Write;

use servodance_types::{BodyJoint, JOINT_COUNT};

use super::Clip;
use super::Pose;
use super::rotation::{IDENTITY, Matrix, apply, multiply, transposed};
use super::vec3::{Vec3, add, cross, dot, norm, scale, sub, unit_or, wide};

/// Which way each bone points from its parent in the T-pose; made unit length
/// where it is used.
pub fn rest_direction(joint: BodyJoint) -> Vec3 {
    use BodyJoint::*;
    let side = |joint: BodyJoint| {
        if joint.name().starts_with("left") { 1.0 } else { -1.0 }
    };
    match joint {
        Pelvis => [0.0; 3],
        LeftHip | RightHip => [0.6 * side(joint), -0.8, 0.0],
        LeftKnee | RightKnee | LeftAnkle | RightAnkle => [0.0, -1.0, 0.0],
        LeftFoot | RightFoot => [0.0, -0.4, 0.9],
        LeftCollar | RightCollar => [0.6 * side(joint), 0.8, 0.0],
        Spine1 | Spine2 | Spine3 | Neck | Head => [0.0, 1.0, 0.0],
        _ => [side(joint), 0.0, 0.0],
    }
}

fn children(joint: BodyJoint) -> Vec<BodyJoint> {
    let all = BodyJoint::ALL.into_iter();
    all.filter(|other| other.parent() == Some(joint)).collect()
}

/// The text of a BVH file.
pub fn bvh(clip: &Clip) -> String {
    let offsets = offsets(&clip.poses);
    let mut text = String::from("HIERARCHY\n");
    let mut order = Vec::new();
    write_joint(&mut text, &mut order, &offsets, BodyJoint::Pelvis, 0);
    // Writing to a String cannot fail.
    let _ =
        write!(text, "MOTION\nFrames: {}\nFrame Time: {:.6}\n", clip.poses.len(), 1.0 / clip.fps);
    for pose in &clip.poses {
        let [x, y, z] = pose[0];
        let _ = write!(text, "{x:.5} {y:.5} {z:.5}");
        let turns = turns(pose, &offsets);
        for joint in &order {
            let [z, x, y] = euler_zxy_deg(&turns[*joint as usize]);
            let _ = write!(text, " {z:.4} {x:.4} {y:.4}");
        }
        text.push('\n');
    }
    text
}

/// Every joint's place relative to its parent in the T-pose, metres.
fn offsets(poses: &[Pose]) -> [Vec3; JOINT_COUNT] {
    std::array::from_fn(|j| {
        let joint = BodyJoint::ALL[j];
        let Some(parent) = joint.parent() else {
            return [0.0; 3];
        };
        let length: f64 = poses
            .iter()
            .map(|pose| norm(sub(wide(pose[j]), wide(pose[parent as usize]))))
            .sum::<f64>()
            / poses.len().max(1) as f64;
        scale(unit_or(rest_direction(joint), [0.0, 1.0, 0.0]), length)
    })
}

fn write_joint(
    text: &mut String,
    order: &mut Vec<BodyJoint>,
    offsets: &[Vec3; JOINT_COUNT],
    joint: BodyJoint,
    depth: usize,
) {
    let pad = "\t".repeat(depth);
    let [x, y, z] = offsets[joint as usize];
    let children = children(joint);
    let kind = if depth == 0 { "ROOT" } else { "JOINT" };
    let position = if depth == 0 { "6 Xposition Yposition Zposition" } else { "3" };
    let _ = write!(
        text,
        "{pad}{kind} {}\n{pad}{{\n{pad}\tOFFSET {x:.5} {y:.5} {z:.5}\n\
         {pad}\tCHANNELS {position} Zrotation Xrotation Yrotation\n",
        joint.name()
    );
    order.push(joint);
    for child in &children {
        write_joint(text, order, offsets, *child, depth + 1);
    }
    if children.is_empty() {
        let _ = write!(text, "{pad}\tEnd Site\n{pad}\t{{\n{pad}\t\tOFFSET 0 0 0\n{pad}\t}}\n");
    }
    let _ = writeln!(text, "{pad}}}");
}

/// How each joint is turned against its parent.
fn turns(pose: &Pose, offsets: &[Vec3; JOINT_COUNT]) -> [Matrix; JOINT_COUNT] {
    let mut world = [IDENTITY; JOINT_COUNT];
    let mut local = [IDENTITY; JOINT_COUNT];
    for joint in BodyJoint::ALL {
        let j = joint as usize;
        let parent = joint.parent().map_or(IDENTITY, |p| world[p as usize]);
        let bone = |child: BodyJoint| sub(wide(pose[child as usize]), wide(pose[j]));
        world[j] = match children(joint)[..] {
            [] => parent,
            [only] => {
                let rest = apply(&parent, offsets[only as usize]);
                multiply(&shortest_turn(rest, bone(only)), &parent)
            }
            // The line between two children gives the side, the third child up.
            [left, right, up] | [up, left, right] if left.mirrored() == right => {
                frame(sub(bone(left), bone(right)), bone(up))
            }
            _ => parent,
        };
        local[j] = multiply(&transposed(&parent), &world[j]);
    }
    local
}

/// The turn that brings +x along `side` and +y as near `up` as that leaves.
fn frame(side: Vec3, up: Vec3) -> Matrix {
    let x = unit_or(side, [1.0, 0.0, 0.0]);
    let y = unit_or(sub(up, scale(x, dot(up, x))), [0.0, 1.0, 0.0]);
    transposed(&[x, y, cross(x, y)])
}

/// The smallest turn that brings the direction `from` to
/// the direction `to` (Rodrigues).
fn shortest_turn(from: Vec3, to: Vec3) -> Matrix {
    let from = unit_or(from, [0.0, 1.0, 0.0]);
    let to = unit_or(to, from);
    let axis = cross(from, to);
    let cosine = dot(from, to);
    if cosine < -0.999_999 {
        // Half a turn about any axis across.
        let across = unit_or(cross(from, [1.0, 0.0, 0.0]), [0.0, 0.0, 1.0]);
        return std::array::from_fn(|i| sub(scale(across, 2.0 * across[i]), IDENTITY[i]));
    }
    let [x, y, z] = axis;
    let skew = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
    let squared = multiply(&skew, &skew);
    std::array::from_fn(|i| add(add(IDENTITY[i], skew[i]), scale(squared[i], 1.0 / (1.0 + cosine))))
}

/// Angles z, x, y in degrees of `m = Rz Rx Ry`.
fn euler_zxy_deg(m: &Matrix) -> Vec3 {
    let x = m[2][1].clamp(-1.0, 1.0).asin();
    let (z, y) = if m[2][1].abs() < 0.999_999 {
        ((-m[0][1]).atan2(m[1][1]), (-m[2][0]).atan2(m[2][2]))
    } else {
        (m[1][0].atan2(m[0][0]), 0.0)
    };
    [z, x, y].map(f64::to_degrees)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn about(axis: usize, deg: f64) -> Matrix {
        let (sin, cos) = deg.to_radians().sin_cos();
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut m = IDENTITY;
        (m[a][a], m[a][b], m[b][a], m[b][b]) = (cos, -sin, sin, cos);
        m
    }

    #[test]
    fn euler_angles_give_the_turn_back() {
        for (z, x, y) in [(10.0, 20.0, 30.0), (-170.0, 60.0, 100.0), (5.0, -89.0, 0.0)] {
            let m = multiply(&multiply(&about(2, z), &about(0, x)), &about(1, y));
            for (found, wanted) in euler_zxy_deg(&m).iter().zip([z, x, y]) {
                assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
            }
        }
    }
}
