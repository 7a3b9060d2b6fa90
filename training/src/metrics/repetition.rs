//! Repetition within a dance: figures of four beats compared with each other.

use servodance_types::JOINT_COUNT;

use servodance_model::motion::representation::heading_rad;
use servodance_model::motion::vec3::{norm, sub, turn, wide};
use servodance_model::motion::{Clip, Pose};

const BEATS: usize = 4;
const POSES: usize = 16;

/// A pose as seen from the body, place and heading removed, metres.
pub type BodyPose = [[f64; 3]; JOINT_COUNT];

/// How far each figure of four beats is from the most similar other one of the
/// same dance: mean distance of the same joints, metres, averaged over figures.
/// Figures begin on every beat and are compared with those that share no beat
/// with them, whatever the tempo. `None` below eight beats.
pub fn nearest_figure_m(clip: &Clip, beats_s: &[f64]) -> Option<f64> {
    let end_s = clip.duration_s();
    let beats: Vec<f64> = beats_s.iter().copied().filter(|t| (0.0..=end_s).contains(t)).collect();
    let figures: Vec<Vec<BodyPose>> =
        beats.windows(BEATS + 1).map(|span| figure(clip, span[0], span[BEATS])).collect();
    let nearest = |i: usize| {
        let others = (0..figures.len()).filter(|j| j.abs_diff(i) >= BEATS);
        others.map(|j| distance_m(&figures[i], &figures[j])).reduce(f64::min)
    };
    let gaps: Vec<f64> = (0..figures.len()).filter_map(nearest).collect();
    (!gaps.is_empty()).then(|| gaps.iter().sum::<f64>() / gaps.len() as f64)
}

/// Mean distance of joints, metres, without place and heading; `None` without frames.
pub fn distance_of_dances_m(a: &[Pose], b: &[Pose]) -> Option<f64> {
    let frames = a.len().min(b.len());
    let [a, b] =
        [a, b].map(|poses| -> Vec<BodyPose> { poses[..frames].iter().map(body_pose).collect() });
    (frames > 0).then(|| distance_m(&a, &b))
}

/// The poses of a figure that lasts from one time to another, as many for each figure.
pub fn figure(clip: &Clip, from_s: f64, to_s: f64) -> Vec<BodyPose> {
    let at = |i: usize| from_s + (to_s - from_s) * i as f64 / POSES as f64;
    (0..POSES).map(|i| body_pose(&clip.pose_at(at(i)))).collect()
}

pub fn body_pose(pose: &Pose) -> BodyPose {
    let heading = heading_rad(pose);
    let [x, _, z] = wide(pose[0]);
    pose.map(|point| turn(sub(wide(point), [x, 0.0, z]), -heading))
}

/// Mean distance of the same joints of two figures of as many poses, metres.
pub fn distance_m(a: &[BodyPose], b: &[BodyPose]) -> f64 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    let sum: f64 = pairs.map(|(p, q)| norm(sub(*p, *q))).sum();
    sum / (a.len() * JOINT_COUNT) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Standing, the left wrist at a height that may change.
    fn dance(height_m: impl Fn(f64) -> f64) -> Clip {
        let pose = |i: usize| -> Pose {
            let t = i as f64 / 20.0;
            let mut pose: Pose = std::array::from_fn(|j| [0.01 * j as f32, 1.0, 0.0]);
            pose[20][1] = height_m(t) as f32;
            // Walking does not count.
            pose.map(|[x, y, z]| [x + 0.3 * t as f32, y, z])
        };
        Clip { name: "case".into(), fps: 20.0, poses: (0..241).map(pose).collect() }
    }

    fn beats() -> Vec<f64> {
        (0..24).map(|i| 0.5 * f64::from(i)).collect()
    }

    #[test]
    fn a_dance_that_repeats_itself_has_no_distance() {
        let repeating = dance(|t| 1.0 + 0.2 * (std::f64::consts::PI * t).sin());
        assert!(nearest_figure_m(&repeating, &beats()).unwrap() < 1e-4);
        assert_eq!(nearest_figure_m(&repeating, &beats()[..7]), None);
    }

    #[test]
    fn a_wrist_that_rises_is_as_far_as_it_rose_in_four_beats() {
        // 0.11 m a second, 0.22 m in four beats of half a second, one joint of 22.
        let rising = dance(|t| 0.5 + 0.11 * t);
        let gap = nearest_figure_m(&rising, &beats()).unwrap();
        assert!((gap - 0.01).abs() < 1e-4, "{gap}");
        let higher = dance(|t| 0.72 + 0.11 * t);
        let apart = distance_of_dances_m(&rising.poses, &higher.poses).unwrap();
        assert!((apart - 0.01).abs() < 1e-4, "{apart}");
    }
}
