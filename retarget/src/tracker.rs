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
//! Inside the interval the target is followed with a look ahead: see `preview`.
//! Changes of acceleration are held to the jerk limit wherever the other limits
//! leave that choice; cycles in which they do not are reported.

use std::collections::VecDeque;

use servodance_types::JointLimits;

use crate::preview::Preview;

/// How much of an observed velocity error is taken over in one cycle.
const OBSERVED_SHARE: f64 = 0.2;
/// State of one joint's output.
pub(crate) struct Tracker {
    limits: JointLimits,
    jerk_rad_s3: f64,
    dt_s: f64,
    position: f64,
    velocity: f64,
    acceleration: f64,
    preview: Preview,
    /// Targets of the next cycles, nearest first.
    targets: VecDeque<f64>,
}

impl Tracker {
    /// At rest at `position_rad`, which may be outside the limits: it is then
    /// led back inside.
    pub fn new(limits: JointLimits, jerk_rad_s3: f64, dt_s: f64, position_rad: f64) -> Self {
        let preview = Preview::new(dt_s);
        // One place more, so that pushing before popping does not allocate.
        let mut targets = VecDeque::with_capacity(preview.cycles() + 1);
        targets.resize(preview.cycles(), limits.clamp_rad(position_rad));
        Self {
            limits,
            jerk_rad_s3,
            dt_s,
            position: position_rad,
            velocity: 0.0,
            acceleration: 0.0,
            preview,
            targets,
        }
    }

    pub fn position(&self) -> f64 {
        self.position
    }

    /// Cycles between a target's coming and its being due.
    pub fn preview_cycles(&self) -> usize {
        self.preview.cycles() - 1
    }

    /// One cycle, taking in the target that is due in
    /// [`preview_cycles`](Self::preview_cycles); one that is not finite repeats
    /// the last. Says whether the jerk limit gave way to another limit.
    pub fn step(&mut self, target_rad: f64) -> bool {
        let wanted = self.aim(target_rad);
        self.go(wanted)
    }

    /// The next position on the way along the targets, not yet taken and not
    /// yet limited. Call once a cycle, then [`go`](Self::go).
    pub fn aim(&mut self, target_rad: f64) -> f64 {
        self.targets.push_back(match target_rad.is_finite() {
            true => self.limits.clamp_rad(target_rad),
            false => self.targets.back().copied().unwrap_or(self.position),
        });
        self.targets.pop_front();
        let acceleration = self.preview.acceleration(
            [self.position, self.velocity, self.acceleration],
            self.targets.iter().copied(),
            self.limits.acceleration_rad_s2,
        );
        self.position + (self.velocity + acceleration * self.dt_s) * self.dt_s
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DT: f64 = 0.01;
    /// Cycles that targets are known ahead.
    const AHEAD: usize = 29;

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
            let due = target(k - AHEAD);
            assert!((track[k + 2] - due).abs() < 5e-3, "{} {due}", track[k + 2]);
        }
    }

    #[test]
    fn a_target_beyond_the_limits_is_met_in_phase() {
        for size in [0.1, 0.3, 0.6, 1.0] {
            let target = |k: f64| size * (k * DT * std::f64::consts::TAU * 2.0).sin();
            let track = follow((0..1000).map(|k| target(k as f64)), 0.0);
            let score = |delay: i32| -> f64 {
                (300..900)
                    .map(|k| track[k + 2] * target((k as i32 - AHEAD as i32 - delay).into()))
                    .sum()
            };
            let delay = (-15..=15)
                .max_by(|a, b| score(*a).total_cmp(&score(*b)))
                .unwrap();
            assert!(delay.abs() <= 2, "size {size}: {delay} cycles late");
        }
    }

    #[test]
    fn a_step_is_approached_without_overshoot() {
        let track = follow(std::iter::repeat_n(1.0, 300), 0.0);
        let highest = track.iter().copied().fold(f64::MIN, f64::max);
        assert!(highest < 1.03, "{highest}");
        assert!((track[300] - 1.0).abs() < 1e-3);
        let there = track.iter().position(|p| *p > 0.99).unwrap();
        // 1 rad at 35 rad/s2 and 4 rad/s takes 0.36 s at best; half of that
        // is before the step is due.
        assert!(there < AHEAD + 40, "{there} cycles");
    }

    #[test]
    fn a_start_outside_the_limits_comes_back_inside() {
        let track = follow(std::iter::repeat_n(0.0, 300), 2.5);
        let outside = track.windows(2).filter(|p| p[0] > limits().upper_rad);
        assert!(outside.clone().count() > 10 && outside.clone().count() < 100);
        assert!(outside.clone().all(|p| p[1] <= p[0]));
        assert!(track[300].abs() < 1e-3);
    }
}
