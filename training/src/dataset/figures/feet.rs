//! Feet that stand, and how they are kept in their places.

use servodance_model::motion::{Clip, Pose, skeleton};
use servodance_types::BodyJoint;

/// A toe that is lower and slower stands: metres, metres a second.
const HEIGHT_M: f32 = 0.06;
const SPEED_M_S: f32 = 0.4;
/// Frames over which a foot is led to its place and away from it.
const FADE: usize = 3;
const TOES: [BodyJoint; 2] = [BodyJoint::LeftFoot, BodyJoint::RightFoot];
const ANKLES: [BodyJoint; 2] = [BodyJoint::LeftAnkle, BodyJoint::RightAnkle];

/// Which feet stand at a moment of a motion, left and right.
pub(super) fn standing(clip: &Clip, time_s: f64) -> [bool; 2] {
    let step_s = 1.0 / clip.fps;
    let [before, after] = [time_s - 0.5 * step_s, time_s + 0.5 * step_s].map(|t| clip.pose_at(t));
    TOES.map(|toe| {
        let [a, b] = [before[toe as usize], after[toe as usize]];
        let speed = (b[0] - a[0]).hypot(b[2] - a[2]) * clip.fps as f32;
        b[1] < HEIGHT_M && speed < SPEED_M_S
    })
}

/// Keeps each foot where it comes to stand for as long as it is said to stand.
pub(super) fn keep(poses: &mut [Pose], standing: &[[bool; 2]]) {
    for side in 0..2 {
        let mut from = 0;
        while from < poses.len() {
            if !standing[from][side] {
                from += 1;
                continue;
            }
            let length = standing[from..].iter().take_while(|feet| feet[side]).count();
            keep_span(&mut poses[from..from + length], side);
            from += length;
        }
    }
    for pose in poses {
        *pose = skeleton::fit(pose, 1.0);
    }
}

/// One foot of one stand goes to the middle of where it was.
fn keep_span(poses: &mut [Pose], side: usize) {
    let (toe, ankle) = (TOES[side] as usize, ANKLES[side] as usize);
    let count = poses.len();
    let mean = |axis: usize| poses.iter().map(|pose| pose[toe][axis]).sum::<f32>() / count as f32;
    let place = [mean(0), mean(2)];
    for (frame, pose) in poses.iter_mut().enumerate() {
        let inside = (frame + 1).min(count - frame).min(FADE) as f32 / FADE as f32;
        let shift = [place[0] - pose[toe][0], place[1] - pose[toe][2]].map(|by| by * inside);
        for joint in [toe, ankle] {
            pose[joint][0] += shift[0];
            pose[joint][2] += shift[1];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::quality::foot_skate_ratio;

    #[test]
    fn a_foot_that_slides_while_it_stands_is_kept() {
        let mut pose: Pose = std::array::from_fn(|_| [0.0; 3]);
        for (joint, height) in [(1, 0.9), (4, 0.5), (7, 0.1), (10, 0.03)] {
            pose[joint] = [0.1, height, 0.0];
            pose[joint + 1] = [-0.1, height, 0.0];
        }
        for joint in [0, 3, 6, 9, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21] {
            pose[joint] = [0.0, 0.95 + 0.03 * joint as f32, 0.0];
        }
        pose[4][2] = 0.05;
        pose[5][2] = 0.05;
        let pose = skeleton::fit(&pose, 1.0);
        let slide = |i: usize| -> Pose {
            let mut moved = pose;
            moved[10][0] += 0.03 * i as f32;
            moved[7][0] += 0.03 * i as f32;
            moved
        };
        let mut poses: Vec<Pose> = (0..20).map(slide).collect();
        let before = foot_skate_ratio(&Clip::of_frames(poses.clone())).unwrap();
        keep(&mut poses, &[[true, true]; 20]);
        let after = foot_skate_ratio(&Clip::of_frames(poses)).unwrap();
        assert!(after < 0.6 * before, "{before} {after}");
    }
}
