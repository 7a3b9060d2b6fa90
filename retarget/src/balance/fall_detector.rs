//! A fall that is coming: the capture point (Pratt, 2006) of a body that turns as a
//! whole has left the soles by more than the ankles can bring back.

use k::nalgebra::Vector3;

use crate::dynamics::GRAVITY_M_S2;

/// How far outside the soles the capture point has to be, as a share of the height of
/// the centre of mass, and for how long, seconds.
const OUTSIDE_SHARE: f64 = 0.12;
const FOR_S: f64 = 0.02;
/// A robot that is as upright as this has not begun to fall, radians.
const UPRIGHT_RAD: f64 = 0.07;

/// Watches one robot on its feet.
pub(super) struct FallDetector {
    height_m: f64,
    for_cycles: u32,
    outside_cycles: u32,
}

impl FallDetector {
    /// For a centre of mass at `height_m`, looked at every `dt_s`.
    pub fn new(height_m: f64, dt_s: f64) -> Self {
        let for_cycles = (FOR_S / dt_s).round().max(1.0) as u32;
        Self { height_m, for_cycles, outside_cycles: 0 }
    }

    /// Whether the robot falls. `lean_rad` and `rate_rad_s` about x and y are what is
    /// beyond the plan; `outside_m` is how far outside the soles the planned centre of
    /// mass would be if it were moved by a vector.
    pub fn observe(
        &mut self,
        lean_rad: [f64; 2],
        rate_rad_s: [f64; 2],
        outside_m: impl FnOnce(Vector3<f64>) -> f64,
    ) -> bool {
        let per_s = (GRAVITY_M_S2 / self.height_m).sqrt();
        let [about_x, about_y] = [0, 1].map(|axis| lean_rad[axis] + rate_rad_s[axis] / per_s);
        let shift = Vector3::new(about_y, -about_x, 0.0) * self.height_m;
        let leans = lean_rad[0].hypot(lean_rad[1]) > UPRIGHT_RAD;
        match leans && outside_m(shift) > OUTSIDE_SHARE * self.height_m {
            true => self.outside_cycles += 1,
            false => self.outside_cycles = 0,
        }
        self.outside_cycles >= self.for_cycles
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOLE_M: f64 = 0.06;

    fn watched(lean_rad: f64, rate_rad_s: f64) -> bool {
        let mut detector = FallDetector::new(0.25, 0.01);
        let outside = |shift: Vector3<f64>| shift.x.abs() - SOLE_M;
        detector.observe([0.0, lean_rad], [0.0, rate_rad_s], outside);
        detector.observe([0.0, lean_rad], [0.0, rate_rad_s], outside)
    }

    #[test]
    fn a_lean_that_the_soles_carry_is_no_fall() {
        assert!(!watched(0.1, 0.5));
    }

    #[test]
    fn a_lean_that_grows_fast_is_a_fall() {
        assert!(watched(0.2, 1.5));
    }

    #[test]
    fn a_robot_that_comes_back_does_not_fall() {
        assert!(!watched(0.35, -1.5));
    }
}
