//! Targets as whole numbers that stay inside a joint's limits.

use crate::servo::Servo;

/// The lowest and highest whole number that `exact` gives inside a joint's limits.
pub(crate) fn whole_range(servo: &Servo, exact: impl Fn(f64) -> f64) -> (f64, f64) {
    let a = exact(servo.limits.lower_rad);
    let b = exact(servo.limits.upper_rad);
    // A limit that is a whole number must survive its own rounding error.
    let lowest = (a.min(b) - 1e-6).ceil();
    (lowest, (a.max(b) + 1e-6).floor().max(lowest))
}
