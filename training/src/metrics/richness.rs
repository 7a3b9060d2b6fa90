//! How rich a dance is: how much of it the legs dance, how many ways the body moves, how
//! far it turns and travels, and how often it shows a figure that was not there before.
//! Y up, metres, seconds.

use super::repetition::{BodyPose, body_pose, distance_m};
use serde::Serialize;
use servodance_model::motion::representation::heading_rad;
use servodance_model::motion::vec3::{dot, sub, wide};
use servodance_model::motion::{Clip, Pose};
use servodance_types::{BodyJoint, JOINT_COUNT};
use std::f64::consts::{PI, TAU};

/// Length of a figure, seconds.
const FIGURE_S: f64 = 2.0;
/// A figure is new if a joint is on average further than this from all before it, metres.
const NEW_M: f64 = 0.12;

/// How rich a dance is, or a set of dances on average.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Richness {
    /// Share of the legs in the kinetic energy against the pelvis, all joints of one mass.
    pub legs_share: f64,
    /// Effective dimensions of the poses without place and heading: the square of the sum of
    /// the variances of all principal components over the sum of their squares.
    pub dimensions: f64,
    /// Mean size of the change of heading, rad/s.
    pub turning_rad_s: f64,
    /// Mean speed of the pelvis over the floor, m/s.
    pub travel_m_s: f64,
    /// Stretches of 2 s that are further than 0.12 m a joint from all before, a minute.
    pub figures_per_min: f64,
}

impl Richness {
    /// Of one dance; `None` below two seconds or where nothing moves.
    pub fn of(clip: &Clip) -> Option<Self> {
        let seconds = clip.poses.len().checked_sub(1)? as f64 / clip.fps;
        if seconds < FIGURE_S {
            return None;
        }
        let poses: Vec<BodyPose> = clip.poses.iter().map(body_pose).collect();
        Some(Self {
            legs_share: legs_share(&clip.poses)?,
            dimensions: effective_dimensions(&poses)?,
            turning_rad_s: turned_rad(&clip.poses) / seconds,
            travel_m_s: travelled_m(&clip.poses) / seconds,
            figures_per_min: 60.0 * new_figures(&poses, clip.fps) as f64 / seconds,
        })
    }

    /// Each figure averaged over dances.
    pub fn mean(all: &[Self]) -> Self {
        let over =
            |value: fn(&Self) -> f64| all.iter().map(value).sum::<f64>() / all.len().max(1) as f64;
        Self {
            legs_share: over(|r| r.legs_share),
            dimensions: over(|r| r.dimensions),
            turning_rad_s: over(|r| r.turning_rad_s),
            travel_m_s: over(|r| r.travel_m_s),
            figures_per_min: over(|r| r.figures_per_min),
        }
    }
}

/// Hips to feet; the pelvis is none.
pub(crate) fn is_leg(joint: BodyJoint) -> bool {
    use BodyJoint::*;
    matches!(
        joint,
        LeftHip | LeftKnee | LeftAnkle | LeftFoot | RightHip | RightKnee | RightAnkle | RightFoot
    )
}

fn legs_share(poses: &[Pose]) -> Option<f64> {
    let (mut legs, mut all) = (0.0, 0.0);
    for pair in poses.windows(2) {
        for joint in BodyJoint::ALL {
            let [before, after] =
                [0, 1].map(|k| sub(wide(pair[k][joint as usize]), wide(pair[k][0])));
            let step = sub(after, before);
            let energy = dot(step, step);
            all += energy;
            legs += if is_leg(joint) { energy } else { 0.0 };
        }
    }
    (all > 0.0).then(|| legs / all)
}

/// Trace and Frobenius norm of the covariance tell the sums; no decomposition is needed.
fn effective_dimensions(poses: &[BodyPose]) -> Option<f64> {
    const WIDTH: usize = 3 * JOINT_COUNT;
    let mut mean = [0.0; WIDTH];
    for pose in poses {
        for (mean, value) in mean.iter_mut().zip(pose.as_flattened()) {
            *mean += value / poses.len() as f64;
        }
    }
    let mut covariance = vec![[0.0; WIDTH]; WIDTH];
    for pose in poses {
        let off: Vec<f64> = pose.as_flattened().iter().zip(&mean).map(|(v, m)| v - m).collect();
        for (row, a) in covariance.iter_mut().zip(&off) {
            row.iter_mut().zip(&off).for_each(|(cell, b)| *cell += a * b);
        }
    }
    let trace: f64 = (0..WIDTH).map(|i| covariance[i][i]).sum();
    let squares: f64 = covariance.as_flattened().iter().map(|c| c * c).sum();
    (squares > 0.0).then(|| trace * trace / squares)
}

fn turned_rad(poses: &[Pose]) -> f64 {
    let change = |pair: &[Pose]| {
        let change = heading_rad(&pair[1]) - heading_rad(&pair[0]);
        ((change + PI).rem_euclid(TAU) - PI).abs()
    };
    poses.windows(2).map(change).sum()
}

fn travelled_m(poses: &[Pose]) -> f64 {
    let step = |pair: &[Pose]| {
        let [a, b] = [wide(pair[0][0]), wide(pair[1][0])];
        (b[0] - a[0]).hypot(b[2] - a[2])
    };
    poses.windows(2).map(step).sum()
}

/// Figures one after the other; the first one is new.
fn new_figures(poses: &[BodyPose], fps: f64) -> usize {
    let frames = ((FIGURE_S * fps).round() as usize).max(1);
    let figures: Vec<&[BodyPose]> = poses.chunks_exact(frames).collect();
    let is_new = |at: &usize| figures[..*at].iter().all(|f| distance_m(f, figures[*at]) > NEW_M);
    (0..figures.len()).filter(is_new).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body of points around the pelvis; `moved` adds to each joint at each second.
    fn dance(moved: impl Fn(f64, BodyJoint) -> [f64; 3]) -> Clip {
        let pose = |i: usize| -> Pose {
            BodyJoint::ALL.map(|joint| {
                let side = match joint.name().split_once('_') {
                    Some(("left", _)) => 0.2,
                    Some(_) => -0.2,
                    None => 0.0,
                };
                let [x, y, z] = moved(i as f64 / 20.0, joint);
                [(side + x) as f32, (1.0 + y) as f32, z as f32]
            })
        };
        Clip::of_frames((0..241).map(pose).collect())
    }

    #[test]
    fn a_knee_that_moves_as_far_as_a_wrist_has_half_the_energy() {
        let clip = dance(|t, joint| match joint {
            BodyJoint::LeftKnee | BodyJoint::LeftWrist => [0.0, 0.2 * (4.0 * t).sin(), 0.0],
            _ => [0.0; 3],
        });
        let found = Richness::of(&clip).unwrap();
        assert!((found.legs_share - 0.5).abs() < 1e-3, "{found:?}");
        // Both move along one line.
        assert!((found.dimensions - 1.0).abs() < 1e-3, "{found:?}");
        assert_eq!(found.figures_per_min.round(), 5.0);
    }

    #[test]
    fn two_independent_movements_are_two_dimensions() {
        let clip = dance(|t, joint| match joint {
            BodyJoint::LeftKnee => [0.0, 0.2 * (TAU * t).sin(), 0.0],
            BodyJoint::LeftWrist => [0.0, 0.2 * (TAU * t).cos(), 0.0],
            _ => [0.0; 3],
        });
        let found = Richness::of(&clip).unwrap();
        assert!((found.dimensions - 2.0).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn a_walk_in_a_circle_turns_and_travels_and_is_no_figure() {
        let turning = |t: f64, joint: BodyJoint| {
            let side = if joint.name().starts_with("left") { 0.2 } else { -0.2 };
            let side = if joint.name().contains('_') { side } else { 0.0 };
            let (sin, cos) = (0.5 * t).sin_cos();
            // About the middle, 2 m from it, at half a radian a second.
            [2.0 * cos + side * (cos - 1.0), 0.0, -2.0 * sin - side * sin]
        };
        let clip = dance(|t, joint| {
            let [x, y, z] = turning(t, joint);
            let wave = if joint == BodyJoint::Head { 0.1 * t.sin() } else { 0.0 };
            [x, y + wave, z]
        });
        let found = Richness::of(&clip).unwrap();
        assert!((found.turning_rad_s - 0.5).abs() < 0.01, "{found:?}");
        assert!((found.travel_m_s - 1.0).abs() < 0.01, "{found:?}");
        assert!((found.figures_per_min - 5.0).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn what_stands_has_no_richness() {
        assert_eq!(Richness::of(&dance(|_, _| [0.0; 3])), None);
        let mut short = dance(|t, _| [t, 0.0, 0.0]);
        short.poses.truncate(30);
        assert_eq!(Richness::of(&short), None);
    }
}
