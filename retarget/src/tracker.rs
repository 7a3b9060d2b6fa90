//! One joint follows a moving target inside its limits, every cycle.
//!
//! Velocity and acceleration are what a servo would see: differences of
//! successive positions over the cycle time. Each step chooses the next
//! velocity from the interval that
//! - the velocity limit allows,
//! - the acceleration limit allows,
//! - leaves braking distance before both position limits:
//!   `v dt + v^2 / 2a <= distance`. If that holds in one cycle, braking keeps it
//!   in the next, so the interval is never empty (property tested).
//!
//! Inside the interval the target is followed by time-optimal control of the
//! tracking error (Han 1999, `fhan`) with the target's own velocity and
//! acceleration fed forward: a target inside the limits is met without lag, one
//! outside is caught up with as fast as the limits allow, without overshoot.
//! Changes of acceleration are held to the jerk limit wherever the other limits
//! leave that choice; cycles in which they do not are reported.

use servodance_types::JointLimits;

/// Cycles over which the tracking error is closed: smooths small corrections.
const HORIZON_CYCLES: f64 = 3.0;
/// How much of an observed velocity error is taken over in one cycle.
const OBSERVED_SHARE: f64 = 0.2;
/// Share of the acceleration kept for corrections while the target accelerates.
const LEAST_CORRECTION: f64 = 0.25;

/// State of one joint's output.
#[derive(Clone, Debug)]
pub(crate) struct Tracker {
    limits: JointLimits,
    jerk_rad_s3: f64,
    dt_s: f64,
    position: f64,
    velocity: f64,
    acceleration: f64,
    target: [f64; 3],
}

impl Tracker {
    /// At rest at `position_rad`, which may be outside the limits: it is then
    /// led back inside.
    pub fn new(limits: JointLimits, jerk_rad_s3: f64, dt_s: f64, position_rad: f64) -> Self {
        Self {
            limits,
            jerk_rad_s3,
            dt_s,
            position: position_rad,
            velocity: 0.0,
            acceleration: 0.0,
            target: [position_rad; 3],
        }
    }

    pub fn position(&self) -> f64 {
        self.position
    }

    /// One cycle towards `target_rad`; a target that is not finite is ignored.
    /// Says whether the jerk limit gave way to another limit.
    pub fn step(&mut self, target_rad: f64) -> bool {
        let wanted = self.aim(target_rad);
        self.go(wanted)
    }

    /// The next position on the way to `target_rad`, not yet taken and not yet
    /// limited. Call once a cycle, then [`go`](Self::go).
    pub fn aim(&mut self, target_rad: f64) -> f64 {
        let target = match target_rad.is_finite() {
            true => self.limits.clamp_rad(target_rad),
            false => self.target[2],
        };
        self.target = [self.target[1], self.target[2], target];
        let velocity = self.velocity + self.wanted_acceleration() * self.dt_s;
        self.position + velocity * self.dt_s
    }

    /// Goes straight to `position_rad`, or as near as the limits allow. Says
    /// whether the jerk limit gave way to another limit.
    pub fn go(&mut self, position_rad: f64) -> bool {
        match position_rad.is_finite() {
            true => self.take((position_rad - self.position) / self.dt_s),
            false => self.take(0.0),
        }
    }

    /// Lowest and highest position that the limits, jerk included where
    /// possible, allow in the next cycle.
    pub fn allowed(&self) -> (f64, f64) {
        let (low, high) = self.allowed_velocities();
        let (least, most) = self.smooth_velocities();
        let bound = |velocity: f64| self.position + velocity.clamp(low, high) * self.dt_s;
        (bound(least), bound(most))
    }

    /// Takes the position over from what really happened. The velocity follows
    /// in part: differences of what a solver reached are noisy.
    pub fn observe(&mut self, position: f64) {
        if position.is_finite() {
            let missed = (position - self.position) / self.dt_s;
            let top = self.limits.velocity_rad_s;
            self.velocity = (self.velocity + OBSERVED_SHARE * missed).clamp(-top, top);
            self.position = position;
        }
    }

    fn take(&mut self, wanted: f64) -> bool {
        let (least, most) = self.smooth_velocities();
        let smooth = wanted.clamp(least, most);
        let (low, high) = self.allowed_velocities();
        let velocity = smooth.clamp(low, high);
        let jerk_exceeded = (velocity - smooth).abs() > 1e-9;
        self.acceleration = (velocity - self.velocity) / self.dt_s;
        self.velocity = velocity;
        self.position += velocity * self.dt_s;
        jerk_exceeded
    }

    /// The velocities of the next cycle that keep the jerk limit.
    fn smooth_velocities(&self) -> (f64, f64) {
        let change = self.jerk_rad_s3 * self.dt_s * self.dt_s;
        let coasting = self.velocity + self.acceleration * self.dt_s;
        (coasting - change, coasting + change)
    }

    /// Acceleration that closes the error against the moving target.
    fn wanted_acceleration(&self) -> f64 {
        let dt = self.dt_s;
        let [before, now, next] = self.target;
        let target_velocity = (now - before) / dt;
        let target_acceleration = (next - 2.0 * now + before) / (dt * dt);
        let most = self.limits.acceleration_rad_s2;
        let room = (most - target_acceleration.abs()).max(LEAST_CORRECTION * most);
        target_acceleration
            + time_optimal(
                self.position - now,
                self.velocity - target_velocity,
                room,
                HORIZON_CYCLES * dt,
            )
    }

    /// The velocities of the next cycle that keep every limit now and later.
    fn allowed_velocities(&self) -> (f64, f64) {
        let most = self.limits.acceleration_rad_s2 * self.dt_s;
        let JointLimits {
            lower_rad,
            upper_rad,
            velocity_rad_s: top,
            ..
        } = self.limits;
        // Outside the limits: no farther out.
        let above = (upper_rad - self.position).max(0.0);
        let below = (self.position - lower_rad).max(0.0);
        let high = top.min(self.stoppable(above)).min(self.velocity + most);
        let low = (-top).max(-self.stoppable(below)).max(self.velocity - most);
        // Rounding may cross them by a hair, never by more.
        if low <= high {
            (low, high)
        } else {
            let middle = f64::midpoint(low, high);
            (middle, middle)
        }
    }

    /// The highest velocity from which braking stops within `distance`:
    /// `v dt + v^2 / 2a = distance`.
    fn stoppable(&self, distance: f64) -> f64 {
        let brake = self.limits.acceleration_rad_s2;
        let lost = brake * self.dt_s;
        (lost * lost + 2.0 * brake * distance).sqrt() - lost
    }
}

/// Han's discrete time-optimal control for a double integrator: acceleration at
/// most `most` that brings `error` and `error_rate` to zero without chatter.
fn time_optimal(error: f64, error_rate: f64, most: f64, horizon_s: f64) -> f64 {
    let reach = most * horizon_s * horizon_s;
    let rate = horizon_s * error_rate;
    let ahead = error + rate;
    let root = (reach * (reach + 8.0 * ahead.abs())).sqrt();
    let far = rate + ahead.signum() * (root - reach) / 2.0;
    let a = if ahead.abs() < reach {
        rate + ahead
    } else {
        far
    };
    if a.abs() < reach {
        -most * a / reach
    } else {
        -most * a.signum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DT: f64 = 0.01;

    fn limits() -> JointLimits {
        JointLimits {
            lower_rad: -1.0,
            upper_rad: 1.5,
            velocity_rad_s: 4.0,
            acceleration_rad_s2: 35.0,
        }
    }

    /// Written from the definition of the limits alone.
    fn violations(track: &[f64], limits: &JointLimits) -> usize {
        let velocity: Vec<f64> = track.windows(2).map(|p| (p[1] - p[0]) / DT).collect();
        let acceleration = velocity.windows(2).map(|v| (v[1] - v[0]) / DT);
        let outside = |p: &&f64| **p < limits.lower_rad || **p > limits.upper_rad;
        track.iter().filter(outside).count()
            + velocity
                .iter()
                .filter(|v| v.abs() > limits.velocity_rad_s + 1e-9)
                .count()
            + acceleration
                .filter(|a| a.abs() > limits.acceleration_rad_s2 + 1e-6)
                .count()
    }

    fn follow(targets: impl IntoIterator<Item = f64>, start: f64) -> Vec<f64> {
        let mut tracker = Tracker::new(limits(), 2000.0, DT, start);
        let mut track = vec![start, start];
        for target in targets {
            tracker.step(target);
            track.push(tracker.position());
        }
        track
    }

    proptest! {
        #[test]
        fn no_target_breaks_a_limit(
            targets in prop::collection::vec((-3.0..3.0_f64, 1..30_usize), 1..40),
            start in -1.0..1.5_f64,
        ) {
            let held = targets.iter().flat_map(|&(target, n)| std::iter::repeat_n(target, n));
            prop_assert_eq!(violations(&follow(held, start), &limits()), 0);
        }

        #[test]
        fn noise_and_nan_break_no_limit(
            targets in prop::collection::vec(prop::num::f64::ANY, 1..400),
        ) {
            prop_assert_eq!(violations(&follow(targets, 0.0), &limits()), 0);
        }
    }

    #[test]
    fn a_target_inside_the_limits_is_met_without_lag() {
        let target = |k: usize| 0.3 * (k as f64 * DT * 6.0).sin();
        let track = follow((0..600).map(target), 0.0);
        for k in 200..600 {
            assert!((track[k + 2] - target(k)).abs() < 1e-4);
        }
    }

    #[test]
    fn a_step_is_approached_without_overshoot() {
        let track = follow(std::iter::repeat_n(1.0, 300), 0.0);
        let highest = track.iter().copied().fold(f64::MIN, f64::max);
        assert!(highest < 1.01, "{highest}");
        assert!((track[300] - 1.0).abs() < 1e-3);
        let there = track.iter().position(|p| *p > 0.99).unwrap();
        // 1 rad at 35 rad/s2 and 4 rad/s takes 0.36 s at best.
        assert!(there < 60, "{there} cycles");
    }

    #[test]
    fn a_start_outside_the_limits_comes_back_inside() {
        let track = follow(std::iter::repeat_n(0.0, 300), 2.5);
        assert!(track.windows(2).all(|p| p[1] <= p[0] + 1e-12));
        assert!(track[300].abs() < 1e-3);
    }
}
