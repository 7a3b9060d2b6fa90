//! How far a reconstruction is from its original.

use servodance_types::JOINT_COUNT;

use crate::motion::Pose;
use crate::motion::representation::heading_rad;
use crate::motion::vec3::{norm, sub, turn, wide};

/// Mean per-joint position error, metres: the mean distance between the same
/// joints of the same frames, with each body placed above the origin and
/// facing +z, so that drift of the root does not count (heights do). Over the
/// frames that both have; `None` when there are none.
pub fn mpjpe_m(original: &[Pose], reconstructed: &[Pose]) -> Option<f64> {
    let frames = original.len().min(reconstructed.len());
    let errors = original.iter().zip(reconstructed).map(|(a, b)| {
        let pairs = local(a).into_iter().zip(local(b));
        pairs.map(|(p, q)| norm(sub(p, q))).sum::<f64>() / JOINT_COUNT as f64
    });
    let sum: f64 = errors.sum();
    (frames > 0).then(|| sum / frames as f64)
}

/// The joints with the root above the origin and the body facing +z.
fn local(pose: &Pose) -> [[f64; 3]; JOINT_COUNT] {
    let heading = heading_rad(pose);
    let [x, _, z] = wide(pose[0]);
    pose.map(|point| turn(sub(wide(point), [x, 0.0, z]), -heading))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose() -> Pose {
        std::array::from_fn(|j| {
            let j = j as f32;
            [if j % 2.0 == 0.0 { -0.1 } else { 0.1 }, 1.5 - 0.05 * j, 0.02 * j]
        })
    }

    #[test]
    fn where_the_body_stands_and_faces_does_not_count() {
        let moved = pose().map(|p| {
            let [x, y, z] = turn(wide(p), 1.1);
            [x as f32 + 3.0, y as f32, z as f32 - 2.0]
        });
        assert!(mpjpe_m(&[pose()], &[moved]).unwrap() < 1e-6);
    }

    #[test]
    fn one_joint_off_by_22_millimetres_is_a_mean_error_of_one() {
        let mut other = pose();
        other[20][1] += 0.022;
        let error_m = mpjpe_m(&[pose()], &[other]).unwrap();
        assert!((error_m - 0.001).abs() < 1e-6, "{error_m}");
        assert_eq!(mpjpe_m(&[], &[pose()]), None);
    }
}
