//! Frames that are nearly upright, put upright.

use k::nalgebra::{Unit, UnitQuaternion, Vector3};

/// Turns smaller than this are rounding, larger ones no frame that is meant to be level.
const LEAST_RAD: f64 = 0.02;
const MOST_RAD: f64 = 0.7;

/// The smallest turn after which one axis of a frame with this `rotation` points along `up`;
/// none where the frame is level already, or far from it.
pub(crate) fn level_rotation(
    rotation: &UnitQuaternion<f64>,
    up: &Unit<Vector3<f64>>,
) -> UnitQuaternion<f64> {
    let seen = rotation.inverse() * up.into_inner();
    let mut axis = Vector3::zeros();
    axis[seen.iamax()] = seen[seen.iamax()].signum();
    let turn = UnitQuaternion::rotation_between(&(rotation * axis), up);
    let turn = turn.filter(|turn| (LEAST_RAD..MOST_RAD).contains(&turn.angle()));
    turn.unwrap_or_else(UnitQuaternion::identity)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tilted_frame_is_put_level_and_others_are_left() {
        let up = Vector3::z_axis();
        let of = |angle: f64| UnitQuaternion::from_euler_angles(0.0, angle, 1.0);
        let levelled = level_rotation(&of(0.3), &up) * of(0.3);
        assert!((levelled * Vector3::z() - Vector3::z()).norm() < 1e-9);
        for angle in [0.0, 0.01, 0.75] {
            assert_eq!(level_rotation(&of(angle), &up), UnitQuaternion::identity(), "{angle}");
        }
    }
}
