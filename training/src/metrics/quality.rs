//! Foot skating, physical plausibility, jerk and freezing of one motion. Y up,
//! metres, seconds.

use servodance_types::BodyJoint;

use servodance_model::motion::vec3::{Vec3, add, norm, scale, sub, wide};
use servodance_model::motion::{Clip, Pose, mean_joint_speed};

/// Toes below this height stand on the floor, metres.
const CONTACT_HEIGHT_M: f64 = 0.05;
/// A standing toe that is faster than this skates: 2.5 cm a frame at 20 FPS.
const SKATE_M_S: f64 = 0.5;
const PFC_RATE_HZ: f64 = 30.0;

/// The share of contact frames in which the foot skates: toes below 5 cm in
/// two frames that follow each other, moving sideways faster than 0.5 m/s.
/// `None` when no toe ever touches the floor.
pub fn foot_skate_ratio(clip: &Clip) -> Option<f64> {
    let (mut contacts, mut skates) = (0, 0);
    for pair in clip.poses.windows(2) {
        for toe in [BodyJoint::LeftFoot, BodyJoint::RightFoot] {
            let [a, b] = [0, 1].map(|k| wide(pair[k][toe as usize]));
            if a[1] < CONTACT_HEIGHT_M && b[1] < CONTACT_HEIGHT_M {
                contacts += 1;
                let speed = (b[0] - a[0]).hypot(b[2] - a[2]) * clip.fps;
                skates += u32::from(speed > SKATE_M_S);
            }
        }
    }
    (contacts > 0).then(|| f64::from(skates) / f64::from(contacts))
}

/// Physical foot contact score (EDGE): the root must not accelerate while both
/// feet slide. Mean over frames of the slower joint's horizontal step of the
/// left foot, times that of the right, times the root's acceleration as a share
/// of its largest (downward acceleration left out), times 1e4, at 30 FPS. Lower
/// is better; `None` below three frames, 0 when the root never accelerates.
pub fn pfc(clip: &Clip) -> Option<f64> {
    if clip.poses.len() < 3 {
        return None;
    }
    let poses = clip.resampled(PFC_RATE_HZ).poses;
    let accelerations: Vec<f64> = poses
        .windows(3)
        .map(|w| {
            let [a, b, c] = [0, 1, 2].map(|k| wide(w[k][0]));
            let mut acceleration = scale(sub(add(a, c), scale(b, 2.0)), PFC_RATE_HZ.powi(2));
            acceleration[1] = acceleration[1].max(0.0);
            norm(acceleration)
        })
        .collect();
    let largest = accelerations.iter().copied().fold(0.0, f64::max);
    if largest == 0.0 {
        return Some(0.0);
    }
    let step = |i: usize, joint: BodyJoint| {
        let [a, b] = [i + 1, i + 2].map(|k| wide(poses[k][joint as usize]));
        (b[0] - a[0]).hypot(b[2] - a[2])
    };
    let score = |(i, acceleration): (usize, &f64)| {
        let left = step(i, BodyJoint::LeftAnkle).min(step(i, BodyJoint::LeftFoot));
        let right = step(i, BodyJoint::RightAnkle).min(step(i, BodyJoint::RightFoot));
        left * right * acceleration / largest
    };
    let sum: f64 = accelerations.iter().enumerate().map(score).sum();
    Some(sum / accelerations.len() as f64 * 1e4)
}

/// Mean over joints and frames, m/s^3, for comparing at one frame rate; 0 below four frames.
pub fn mean_jerk_m_s3(clip: &Clip) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for w in clip.poses.windows(4) {
        for joint in BodyJoint::ALL {
            let [a, b, c, d]: [Vec3; 4] = std::array::from_fn(|k| wide(w[k][joint as usize]));
            let third = sub(sub(d, a), scale(sub(c, b), 3.0));
            sum += norm(third) * clip.fps.powi(3);
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

/// Share of seconds whose mean joint speed is below a tenth of the mean of all
/// seconds; 0 below one second.
pub fn frozen_ratio(poses: &[Pose], rate_hz: f64) -> f64 {
    let speed = mean_joint_speed(poses, rate_hz);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let second = (rate_hz.round() as usize).max(1);
    let seconds: Vec<f64> = speed.chunks_exact(second).map(mean).collect();
    let average = mean(&seconds);
    let frozen = seconds.iter().filter(|v| **v < 0.1 * average).count();
    frozen as f64 / seconds.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip(frames: usize, fps: f64, place: impl Fn(usize, usize) -> [f32; 3]) -> Clip {
        Clip {
            name: "case".into(),
            fps,
            poses: (0..frames).map(|i| std::array::from_fn(|j| place(i, j))).collect(),
        }
    }

    #[test]
    fn a_foot_that_slides_every_other_frame_skates_half_the_time() {
        let left = BodyJoint::LeftFoot as usize;
        let skating = clip(21, 20.0, |i, j| {
            // 4 cm every second frame: 0.8 m/s, then 0. The rest is in the air.
            let x = if j == left { 0.04 * (i / 2) as f32 } else { 0.0 };
            [x, if j == left { 0.02 } else { 1.0 }, 0.0]
        });
        assert_eq!(foot_skate_ratio(&skating), Some(0.5));
        let flying = clip(5, 20.0, |_, _| [0.0, 1.0, 0.0]);
        assert_eq!(foot_skate_ratio(&flying), None);
    }

    #[test]
    fn pfc_of_sliding_feet_under_a_steady_push_is_the_product_of_steps() {
        // Root: x = t^2 (acceleration 2 m/s^2 throughout, its own maximum).
        // Feet: 0.3 m/s and 0.6 m/s, 1 cm and 2 cm a frame at 30 FPS.
        let sliding = clip(31, 30.0, |i, j| {
            let t = i as f32 / 30.0;
            match j {
                0 => [t * t, 1.0, 0.0],
                7 | 10 => [0.3 * t, 0.0, 0.0],
                8 | 11 => [0.6 * t, 0.0, 0.0],
                _ => [0.0; 3],
            }
        });
        let score = pfc(&sliding).unwrap();
        assert!((score - 0.01 * 0.02 * 1e4).abs() < 0.03, "{score}");
        let mut planted = sliding.clone();
        for pose in &mut planted.poses {
            pose[7] = [0.0; 3];
        }
        assert!(pfc(&planted).unwrap() < 1e-9);
    }

    #[test]
    fn a_cubic_has_its_jerk() {
        // x = t^3: jerk 6 m/s^3.
        let cubic = clip(20, 20.0, |i, _| [(i as f32 / 20.0).powi(3), 0.0, 0.0]);
        let jerk = mean_jerk_m_s3(&cubic);
        assert!((jerk - 6.0).abs() < 0.05, "{jerk}");
    }

    #[test]
    fn motion_that_stops_half_way_is_frozen() {
        let stopping = clip(201, 20.0, |i, _| [0.05 * i.min(100) as f32, 0.0, 0.0]);
        let frozen = frozen_ratio(&stopping.poses, 20.0);
        assert!((frozen - 0.5).abs() < 0.11, "{frozen}");
        let steady = clip(201, 20.0, |i, _| [0.05 * i as f32, 0.0, 0.0]);
        assert_eq!(frozen_ratio(&steady.poses, 20.0), 0.0);
    }
}
