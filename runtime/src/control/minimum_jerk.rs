//! A minimum-jerk path from one pose to another, far inside the limits. Radians;
//! it begins and ends at zero speed.

use servodance_types::JointLimits;

/// Share of a joint's velocity and acceleration limits that is used.
const EFFORT: f64 = 0.4;
/// Duration of the shortest path, seconds.
const SHORTEST_S: f64 = 0.5;

/// The path of all joints, which begin and arrive together.
#[derive(Clone, Debug)]
pub struct MinimumJerk {
    from_rad: Vec<f64>,
    to_rad: Vec<f64>,
    cycles: u64,
}

impl MinimumJerk {
    /// From one pose to another; `limits` are those of each joint.
    pub fn new<'a>(
        from_rad: &[f64],
        to_rad: &[f64],
        limits: impl Iterator<Item = &'a JointLimits>,
        control_hz: f64,
    ) -> Self {
        Self::with_effort(EFFORT, from_rad, to_rad, limits, control_hz)
    }

    /// The same with another share of the velocity and acceleration limits.
    pub fn with_effort<'a>(
        effort: f64,
        from_rad: &[f64],
        to_rad: &[f64],
        limits: impl Iterator<Item = &'a JointLimits>,
        control_hz: f64,
    ) -> Self {
        let duration_s = limits
            .zip(from_rad.iter().zip(to_rad))
            .map(|(limits, (a, b))| {
                shortest_s(
                    (b - a).abs(),
                    limits.velocity_rad_s * effort,
                    limits.acceleration_rad_s2 * effort,
                )
            })
            .fold(SHORTEST_S, f64::max);
        Self {
            from_rad: from_rad.to_vec(),
            to_rad: to_rad.to_vec(),
            cycles: (duration_s * control_hz).ceil() as u64,
        }
    }

    /// The same path, in no less than so many seconds.
    pub fn lasting(self, seconds: f64, control_hz: f64) -> Self {
        Self { cycles: self.cycles.max((seconds * control_hz).round() as u64), ..self }
    }

    pub fn cycles(&self) -> u64 {
        self.cycles
    }

    /// Writes where the joints are after so many cycles.
    pub fn at(&self, cycle: u64, out_rad: &mut [f64]) {
        let share = minimum_jerk(cycle as f64 / self.cycles as f64);
        let ends = self.from_rad.iter().zip(&self.to_rad);
        for (out, (a, b)) in out_rad.iter_mut().zip(ends) {
            *out = a + share * (b - a);
        }
    }
}

/// Minimum-jerk position between 0 and 1 at a share of the time
/// (Flash and Hogan 1985).
fn minimum_jerk(share: f64) -> f64 {
    share.powi(3) * (10.0 + share * (-15.0 + share * 6.0))
}

/// Duration of the shortest minimum-jerk move over `distance` inside the limits:
/// its peak speed is 15/8 of the mean, its peak acceleration 10/sqrt(3) of
/// distance over time squared.
fn shortest_s(distance: f64, velocity: f64, acceleration: f64) -> f64 {
    let by_velocity = 1.875 * distance / velocity;
    let by_acceleration = (10.0 / 3f64.sqrt() * distance / acceleration).sqrt();
    by_velocity.max(by_acceleration)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minimum_jerk_moves_stay_inside_their_limits() {
        let (distance, velocity, acceleration) = (1.3, 2.0, 9.0);
        let duration = shortest_s(distance, velocity, acceleration);
        let steps = 2000;
        let dt = duration / f64::from(steps);
        let at = |i: i32| distance * minimum_jerk(f64::from(i) / f64::from(steps));
        for i in 1..steps {
            let speed = (at(i + 1) - at(i)) / dt;
            let change = (at(i + 1) - 2.0 * at(i) + at(i - 1)) / (dt * dt);
            assert!(speed <= velocity * 1.001, "{speed}");
            assert!(change.abs() <= acceleration * 1.001, "{change}");
        }
        assert!((at(steps) - distance).abs() < 1e-12);
    }
}
