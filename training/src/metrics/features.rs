//! What a whole motion is like, in a few numbers: kinetic and geometric
//! features, the ground of FID_k, FID_g and Dist.
//!
//! Kinetic (66 for 22 joints): per joint the mean horizontal and vertical
//! kinetic energy (speed squared) and the mean size of the acceleration, each
//! over a sliding window of two frames either side. Geometric (32): booleans
//! about relations between joints, averaged over time. Both count at 60 FPS,
//! as the literature does; other rates are resampled. Y up, metres.
//!
//! Definitions: Onuma et al. 2008 and Müller et al. 2005, as the extractors
//! that dance papers share compute them.

use servodance_types::{BodyJoint, JOINT_COUNT};

use servodance_model::motion::vec3::{Vec3, add, cross, dot, norm, scale, sub, wide};
use servodance_model::motion::{Clip, Pose};

pub const KINETIC_DIM: usize = 3 * JOINT_COUNT;
pub const GEOMETRIC_DIM: usize = 32;

const RATE_HZ: f64 = 60.0;
const WINDOW: isize = 2;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Acceleration {
    /// By its definition: the step of the velocity.
    Correct,
    /// As the extractor behind published figures does: a misplaced bracket takes
    /// the velocity before as `p[i] - p[i-1] / dt`. Only for comparing with papers.
    Published,
}

/// The kinetic features; `None` below three frames.
pub fn kinetic(clip: &Clip, acceleration: Acceleration) -> Option<[f64; KINETIC_DIM]> {
    let positions = at_60_fps(clip)?;
    let mut out = [0.0; KINETIC_DIM];
    for (joint, out) in out.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        let path: Vec<Vec3> = positions.iter().map(|pose| wide(pose[joint])).collect();
        *out = joint_energies(&path, acceleration);
    }
    Some(out)
}

/// Horizontal and vertical kinetic energy and acceleration of one joint.
fn joint_energies(path: &[Vec3], acceleration: Acceleration) -> [f64; 3] {
    let frames = path.len() as isize;
    let at = |i: isize| path[i as usize];
    let mut sums = [0.0; 3];
    for i in 1..frames {
        let (mut velocity, mut steps) = ([0.0; 3], 0.0);
        let (mut change, mut changes) = ([0.0; 3], 0.0);
        for k in i - WINDOW..=i + WINDOW {
            if k < 1 || k >= frames {
                continue;
            }
            let before = scale(sub(at(k), at(k - 1)), RATE_HZ);
            velocity = add(velocity, before);
            steps += 1.0;
            if k + 1 >= frames {
                continue;
            }
            let after = scale(sub(at(k + 1), at(k)), RATE_HZ);
            let before = match acceleration {
                Acceleration::Correct => before,
                Acceleration::Published => sub(at(k), scale(at(k - 1), RATE_HZ)),
            };
            change = add(change, scale(sub(after, before), RATE_HZ));
            changes += 1.0;
        }
        let [x, y, z] = scale(velocity, 1.0 / steps);
        sums[0] += x * x + z * z;
        sums[1] += y * y;
        if changes > 0.0 {
            sums[2] += norm(change) / changes;
        }
    }
    sums.map(|sum| sum / (frames - 1) as f64)
}

/// The geometric features, each the share of frames in which it holds; `None`
/// below three frames. Speeds are steps times 120, whatever the frame rate:
/// so the published extractor has it.
pub fn geometric(clip: &Clip) -> Option<[f64; GEOMETRIC_DIM]> {
    let positions = at_60_fps(clip)?;
    let mut counts = [0.0; GEOMETRIC_DIM];
    for pair in positions.windows(2) {
        let relations = JointRelations { before: pair[0].map(wide), now: pair[1].map(wide) };
        for (count, holds) in counts.iter_mut().zip(relations.all()) {
            *count += f64::from(u8::from(holds));
        }
    }
    Some(counts.map(|count| count / (positions.len() - 1) as f64))
}

fn at_60_fps(clip: &Clip) -> Option<Vec<Pose>> {
    if clip.poses.len() < 3 {
        return None;
    }
    if (clip.fps - RATE_HZ).abs() < 1e-9 {
        return Some(clip.poses.clone());
    }
    Some(clip.resampled(RATE_HZ).poses)
}

/// Lengths of the SMPL body that thresholds are multiples of, metres.
const UPPER_ARM_M: f64 = 0.2568;
const SHOULDERS_M: f64 = 0.3908;
const HIPS_M: f64 = 0.1192;
/// Speeds of geometric features: metres a step to metres a second.
const GEOMETRIC_RATE_HZ: f64 = 120.0;

struct JointRelations {
    before: [Vec3; JOINT_COUNT],
    now: [Vec3; JOINT_COUNT],
}

impl JointRelations {
    fn all(&self) -> [bool; GEOMETRIC_DIM] {
        use BodyJoint::*;
        let (arm, shoulders, hips) = (UPPER_ARM_M, SHOULDERS_M, HIPS_M);
        // The extractor's belly is spine1, its chest spine3, its toes the feet.
        [
            self.moves_off_plane(Neck, RightHip, LeftHip, RightWrist, 1.8 * arm),
            self.moves_off_plane(Neck, LeftHip, RightHip, LeftWrist, 1.8 * arm),
            self.beyond([Spine3, Neck], Neck, RightWrist, 0.2 * arm),
            self.beyond([Spine3, Neck], Neck, LeftWrist, 0.2 * arm),
            self.moves_along(Spine1, Spine3, Spine3, 1.8 * arm),
            self.moves_along(Spine1, Spine3, Spine3, 1.8 * arm),
            self.angle([RightElbow, RightShoulder], [RightElbow, RightWrist], 0.0, 110.0),
            self.angle([LeftElbow, LeftShoulder], [LeftElbow, LeftWrist], 0.0, 110.0),
            self.beyond([LeftShoulder, RightShoulder], LeftWrist, RightWrist, 2.5 * shoulders),
            self.moves_along(LeftWrist, RightWrist, RightWrist, 1.4 * arm),
            self.moves_along(RightWrist, Pelvis, LeftWrist, 1.4 * arm),
            self.moves_along(LeftWrist, Pelvis, RightWrist, 1.4 * arm),
            self.fast(RightWrist, 2.5 * arm),
            self.fast(LeftWrist, 2.5 * arm),
            self.off_plane([Pelvis, LeftHip, LeftFoot], RightAnkle, 0.38 * arm),
            self.off_plane([Pelvis, RightHip, RightFoot], LeftAnkle, 0.38 * arm),
            self.height(RightAnkle) > 1.2 * arm,
            self.height(LeftAnkle) > 1.2 * arm,
            self.beyond([LeftHip, RightHip], LeftAnkle, RightAnkle, 2.1 * hips),
            self.angle([RightKnee, RightHip], [RightKnee, RightAnkle], 0.0, 110.0),
            self.angle([LeftKnee, LeftHip], [LeftKnee, LeftAnkle], 0.0, 110.0),
            self.fast(RightAnkle, 2.5 * arm),
            self.fast(LeftAnkle, 2.5 * arm),
            self.angle([Neck, Pelvis], [RightShoulder, RightElbow], 25.0, 180.0),
            self.angle([Neck, Pelvis], [LeftShoulder, LeftElbow], 25.0, 180.0),
            self.angle([Neck, Pelvis], [RightHip, RightKnee], 50.0, 180.0),
            self.angle([Neck, Pelvis], [LeftHip, LeftKnee], 50.0, 180.0),
            self.off_plane([RightAnkle, Neck, LeftAnkle], Pelvis, 0.5 * arm),
            within(self.bone([Neck, Pelvis]), [0.0, 1.0, 0.0], 70.0, 110.0),
            -self.height(RightWrist) > -1.2 * arm,
            -self.height(LeftWrist) > -1.2 * arm,
            self.fast(Pelvis, 2.3 * arm),
        ]
    }

    fn at(&self, joint: BodyJoint) -> Vec3 {
        self.now[joint as usize]
    }

    fn bone(&self, [from, to]: [BodyJoint; 2]) -> Vec3 {
        sub(self.at(to), self.at(from))
    }

    fn height(&self, joint: BodyJoint) -> f64 {
        let lowest = self.now.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
        self.at(joint)[1] - lowest
    }

    /// Velocity of `joint` against `origin`.
    fn velocity(&self, joint: BodyJoint, origin: BodyJoint) -> Vec3 {
        let before = sub(self.before[joint as usize], self.before[origin as usize]);
        scale(sub(self.bone([origin, joint]), before), GEOMETRIC_RATE_HZ)
    }

    fn moves_along(&self, origin: BodyJoint, to: BodyJoint, joint: BodyJoint, above: f64) -> bool {
        along(self.velocity(joint, origin), self.bone([origin, to])) > above
    }

    fn moves_off_plane(
        &self,
        origin: BodyJoint,
        b: BodyJoint,
        c: BodyJoint,
        joint: BodyJoint,
        above: f64,
    ) -> bool {
        let normal = cross(self.bone([origin, c]), self.bone([origin, b]));
        along(self.velocity(joint, origin), normal) > above
    }

    fn beyond(
        &self,
        normal: [BodyJoint; 2],
        origin: BodyJoint,
        joint: BodyJoint,
        above: f64,
    ) -> bool {
        along(self.bone([origin, joint]), self.bone(normal)) > above
    }

    fn off_plane(&self, [a, b, c]: [BodyJoint; 3], joint: BodyJoint, above: f64) -> bool {
        let normal = cross(self.bone([a, c]), self.bone([a, b]));
        along(self.bone([a, joint]), normal) > above
    }

    fn angle(&self, a: [BodyJoint; 2], b: [BodyJoint; 2], above_deg: f64, below_deg: f64) -> bool {
        within(self.bone(a), self.bone(b), above_deg, below_deg)
    }

    fn fast(&self, joint: BodyJoint, above: f64) -> bool {
        let step = sub(self.at(joint), self.before[joint as usize]);
        norm(step) * GEOMETRIC_RATE_HZ > above
    }
}

/// The part of `v` along `direction`.
fn along(v: Vec3, direction: Vec3) -> f64 {
    dot(v, direction) / norm(direction)
}

/// Whether the angle between two vectors lies between two angles, degrees.
fn within(a: Vec3, b: Vec3, above_deg: f64, below_deg: f64) -> bool {
    let cosine = dot(a, b) / (norm(a) * norm(b));
    let degrees = cosine.clamp(-1.0, 1.0).acos().to_degrees();
    degrees > above_deg && degrees < below_deg
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every joint on its own circle; `golden.py` has the same formula.
    fn circling() -> Clip {
        let pose = |i: usize| -> Pose {
            std::array::from_fn(|j| {
                let (t, j) = (i as f64 / 60.0, j as f64);
                [
                    0.3 * (2.0 * t + j).sin() + 0.1 * j.cos(),
                    1.0 + 0.5 * (1.7 * j).sin() + 0.1 * (3.0 * t + 2.0 * j).cos(),
                    0.2 * (4.0 * t + 0.5 * j).cos() + 0.1 * (2.3 * j).sin(),
                ]
                .map(|v| v as f32)
            })
        };
        Clip { name: "circles".into(), fps: 60.0, poses: (0..120).map(pose).collect() }
    }

    // Made by golden.py.
    const GOLDEN_KINETIC: [f64; 6] = [
        0.522644501902496,
        0.04714022873667009,
        2.3158034816069137,
        63.46288992967455,
        3687.0141818878633,
        81978.10085459553,
    ];
    const GOLDEN_GEOMETRIC: [f64; GEOMETRIC_DIM] = [
        0.23529, 0.7479, 0.0, 0.0, 0.39496, 0.39496, 1.0, 1.0, 0.0, 0.36975, 0.0, 0.77311, 0.95798,
        1.0, 0.45378, 0.51261, 1.0, 0.21008, 0.0, 0.92437, 0.76471, 1.0, 0.97479, 1.0, 0.80672,
        1.0, 0.81513, 0.15126, 0.0, 1.0, 0.0, 0.93277,
    ];

    fn check(actual: f64, golden: f64) {
        let error = (actual - golden).abs() / golden.abs().max(1e-9);
        assert!(error < 1e-3, "{actual} is not {golden}");
    }

    #[test]
    fn kinetic_features_match_the_independent_script() {
        let correct = kinetic(&circling(), Acceleration::Correct).unwrap();
        let published = kinetic(&circling(), Acceleration::Published).unwrap();
        for (actual, golden) in correct.iter().zip(&GOLDEN_KINETIC[..3]) {
            check(*actual, *golden);
        }
        check(correct.iter().sum(), GOLDEN_KINETIC[3]);
        check(published[2], GOLDEN_KINETIC[4]);
        check(published.iter().sum(), GOLDEN_KINETIC[5]);
    }

    #[test]
    fn geometric_features_match_the_independent_script() {
        let features = geometric(&circling()).unwrap();
        for (k, (actual, golden)) in features.iter().zip(GOLDEN_GEOMETRIC).enumerate() {
            assert!((actual - golden).abs() < 0.009, "feature {k}: {actual} is not {golden}");
        }
    }

    #[test]
    fn steady_speed_has_its_square_and_no_acceleration() {
        let mut clip = circling();
        for (i, pose) in clip.poses.iter_mut().enumerate() {
            *pose = [[0.02 * i as f32, 0.01 * i as f32, 0.0]; JOINT_COUNT];
        }
        let features = kinetic(&clip, Acceleration::Correct).unwrap();
        check(features[0], 1.44);
        check(features[1], 0.36);
        assert!(features[2] < 0.01, "{}", features[2]);
    }

    #[test]
    fn a_squatting_body_has_bent_knees_and_low_wrists() {
        let mut clip = circling();
        clip.poses.truncate(3);
        for pose in &mut clip.poses {
            for (j, y) in [(1, 0.3), (4, 0.35), (7, 0.05), (2, 0.3), (5, 0.35), (8, 0.05)] {
                let ahead = if j == 4 || j == 5 { 0.4 } else { 0.0 };
                pose[j] = [0.0, y, ahead];
            }
        }
        let features = geometric(&clip).unwrap();
        assert_eq!((features[19], features[20]), (1.0, 1.0));
    }

    #[test]
    fn two_frames_have_no_features() {
        let mut clip = circling();
        clip.poses.truncate(2);
        assert_eq!(kinetic(&clip, Acceleration::Correct), None);
        assert_eq!(geometric(&clip), None);
    }
}
