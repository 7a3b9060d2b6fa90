//! Headings and soft limits; radians, about the vertical.

use k::nalgebra::{Rotation3, Vector3};

pub(crate) fn turn(angle: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), angle)
}

/// Heading of a body whose left side is this way.
pub(crate) fn yaw_of(left: Vector3<f64>) -> f64 {
    if left.x == 0.0 && left.y == 0.0 {
        return 0.0;
    }
    (-left.x).atan2(left.y)
}

pub(crate) fn wrap(angle: f64) -> f64 {
    let turns = angle / std::f64::consts::TAU;
    (turns - turns.round()) * std::f64::consts::TAU
}

pub(crate) fn mean_angle(a: f64, b: f64) -> f64 {
    a + 0.5 * wrap(b - a)
}

/// Follows small values, never passes `most`.
pub(crate) fn soft_limit(value: f64, most: f64) -> f64 {
    most * (value / most).tanh()
}

pub(crate) fn direction(vector: Vector3<f64>, otherwise: Vector3<f64>) -> Vector3<f64> {
    vector.try_normalize(1e-6).unwrap_or(otherwise)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heading_is_zero_when_left_is_left() {
        assert_eq!(yaw_of(Vector3::y()), 0.0);
        assert!((yaw_of(-Vector3::x()) - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }
}
