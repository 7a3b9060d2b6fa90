//! One joint follows a moving target inside its limits, every cycle.
//!
//! Where to go is planned with a look ahead (see `preview`); how far the joint
//! may go is decided by `limiter`: position, velocity, acceleration and jerk
//! hold in every cycle, whatever is wanted, and braking begins in time.

use crate::limits::predictive_control::{CALM, SHARP};
use crate::limits::target_queue::TargetQueue;
use crate::limits::{JointLimiter, PredictiveController, TrajectoryState};
use servodance_types::JointLimits;

/// Time constant with which an observed error of velocity is taken over, seconds.
const OBSERVED_S: f64 = 0.045;
/// A moving target is met at no more than this difference of speed.
const MEETING_RAD_S: f64 = 0.05;
/// How fast the way to it shrinks, 1/s, and the share of the acceleration limit
/// that is planned with.
const APPROACH_PER_S: f64 = 12.0;
const SOFT: f64 = 0.4;

pub(crate) struct JointTracker {
    /// The limits as they are; wider while a start outside of them comes back.
    limits: JointLimits,
    limiter: JointLimiter,
    state: TrajectoryState,
    controller: PredictiveController,
    followed: Option<f64>,
    targets: TargetQueue,
}

impl JointTracker {
    /// At rest at `position_rad`, which may be outside the limits: it is then
    /// led back inside. Targets are known `preview_s` ahead.
    pub fn new(
        limits: JointLimits,
        jerk_rad_s3: f64,
        dt_s: f64,
        position_rad: f64,
        preview_s: f64,
    ) -> Self {
        Self::for_servo(limits, jerk_rad_s3, dt_s, position_rad, [preview_s, 0.0])
    }

    /// The same for a servo with a lag, if that is not 0: what the servo takes off the
    /// targets is put in beforehand, and quick movement is smoothed less.
    pub fn for_servo(
        limits: JointLimits,
        jerk_rad_s3: f64,
        dt_s: f64,
        position_rad: f64,
        [preview_s, servo_lag_s]: [f64; 2],
    ) -> Self {
        let smoothness = if servo_lag_s > 0.0 { SHARP } else { CALM };
        let controller = PredictiveController::new(dt_s, preview_s, smoothness);
        let first = limits.clamp_rad(position_rad);
        let targets = TargetQueue::new(controller.cycles(), servo_lag_s, dt_s, first);
        let limiter = JointLimiter {
            limits: JointLimits {
                lower_rad: limits.lower_rad.min(position_rad),
                upper_rad: limits.upper_rad.max(position_rad),
                ..limits
            },
            jerk_rad_s3,
            dt_s,
        };
        Self {
            limits,
            limiter,
            state: TrajectoryState::at_rest(position_rad),
            controller,
            followed: None,
            targets,
        }
    }

    /// At rest at `position_rad`.
    pub fn restart(&mut self, position_rad: f64) {
        self.state = TrajectoryState::at_rest(position_rad);
        self.followed = None;
    }

    pub fn position(&self) -> f64 {
        self.state.position
    }

    pub fn preview_cycles(&self) -> usize {
        self.controller.cycles() - 1
    }

    pub fn work(&self) -> u64 {
        self.controller.work()
    }

    /// One cycle, taking in the target that is due in
    /// [`preview_cycles`](Self::preview_cycles); one that is not
    /// finite repeats the last.
    pub fn step(&mut self, target_rad: f64) {
        let wanted = self.plan(target_rad);
        self.advance(wanted);
    }

    /// The next position on the way along the targets, not yet taken and not
    /// yet limited. Call once a cycle, then [`advance`](Self::advance).
    pub fn plan(&mut self, target_rad: f64) -> f64 {
        self.targets.push(match target_rad.is_finite() {
            true => self.limits.clamp_rad(target_rad),
            false => self.targets.newest(),
        });
        let limits = self.limits;
        let targets = self.targets.commands().map(|target| limits.clamp_rad(target));
        let acceleration = self.controller.acceleration(&self.limiter, &self.state, targets);
        let dt_s = self.limiter.dt_s;
        self.state.position + (self.state.velocity + acceleration * dt_s) * dt_s
    }

    /// The next position on the way to one that moves with `target_rad`, call by
    /// call: met exactly where the limits allow, else approached at a speed from
    /// which its own can be taken up.
    pub fn follow(&mut self, target_rad: f64) -> f64 {
        let dt_s = self.limiter.dt_s;
        let speed = match self.followed {
            Some(before) => (target_rad - before) / dt_s,
            None => 0.0,
        };
        self.followed = Some(target_rad);
        let exact = self.limiter.toward(&self.state, target_rad);
        let met = (exact.position - target_rad).abs() < 1e-9
            && (exact.velocity - speed).abs() <= MEETING_RAD_S;
        if met {
            return target_rad;
        }
        let missed = target_rad - speed * dt_s - self.state.position;
        let brake = SOFT * self.limits.acceleration_rad_s2;
        let lost = brake / APPROACH_PER_S;
        let closing =
            (APPROACH_PER_S * missed.abs()).min((lost * lost + 2.0 * brake * missed.abs()).sqrt());
        self.toward_velocity(speed + closing.copysign(missed))
    }

    /// The next position on the way to a steady velocity.
    pub fn toward_velocity(&self, velocity: f64) -> f64 {
        self.limiter.steady(&self.state, velocity).position
    }

    /// Goes straight to `position_rad`, or as near as the limits allow.
    pub fn advance(&mut self, position_rad: f64) {
        self.state = match position_rad.is_finite() {
            true => self.limiter.toward(&self.state, position_rad),
            false => self.limiter.steady(&self.state, 0.0),
        };
        self.narrow_limits();
    }

    /// Once inside the limits for good, never out again.
    fn narrow_limits(&mut self) {
        if self.limiter.limits != self.limits {
            let inside = JointLimiter { limits: self.limits, ..self.limiter };
            if inside.is_safe(&self.state) {
                self.limiter = inside;
            }
        }
    }

    /// Lowest and highest position that the limits allow in the next cycle.
    pub fn reachable(&self) -> (f64, f64) {
        let [low, high] = self.limiter.reach(&self.state);
        (low.position.min(high.position), high.position)
    }

    /// Takes the position over from what really happened. The velocity follows
    /// in part: differences of what a solver reached are noisy.
    pub fn observe(&mut self, position: f64) {
        if position.is_finite() {
            let missed = (position - self.state.position) / self.limiter.dt_s;
            let top = self.limits.velocity_rad_s;
            let share = 1.0 - (-self.limiter.dt_s / OBSERVED_S).exp();
            self.state.velocity = (self.state.velocity + share * missed).clamp(-top, top);
            self.state.position = position;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DT: f64 = 0.01;
    const JERK: f64 = 1000.0;
    const AHEAD: usize = 29;

    fn limits() -> JointLimits {
        JointLimits {
            lower_rad: -1.0,
            upper_rad: 1.5,
            velocity_rad_s: 4.0,
            acceleration_rad_s2: 35.0,
        }
    }

    fn violations(track: &[f64], limits: &JointLimits) -> usize {
        let differences = |values: &[f64]| -> Vec<f64> {
            values.windows(2).map(|p| (p[1] - p[0]) / DT).collect()
        };
        let velocity = differences(track);
        let acceleration = differences(&velocity);
        let jerk = differences(&acceleration);
        let beyond = |values: &[f64], most: f64| values.iter().filter(|v| v.abs() > most).count();
        let outside = |p: &&f64| **p < limits.lower_rad || **p > limits.upper_rad;
        track.iter().filter(outside).count()
            + beyond(&velocity, limits.velocity_rad_s + 1e-9)
            + beyond(&acceleration, limits.acceleration_rad_s2 + 1e-7)
            + beyond(&jerk, JERK + 1e-5)
    }

    fn follow(targets: impl IntoIterator<Item = f64>, start: f64) -> Vec<f64> {
        follow_with_lag(targets, start, 0.0)
    }

    fn follow_with_lag(targets: impl IntoIterator<Item = f64>, start: f64, lag_s: f64) -> Vec<f64> {
        let mut tracker = JointTracker::for_servo(limits(), JERK, DT, start, [0.3, lag_s]);
        let mut track = vec![start, start, start];
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
            let held = || targets.iter().flat_map(|&(target, n)| std::iter::repeat_n(target, n));
            prop_assert_eq!(violations(&follow(held(), start), &limits()), 0);
            let sharpened = follow_with_lag(held(), start, 0.05);
            prop_assert_eq!(violations(&sharpened, &limits()), 0);
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
            assert!((track[k + 3] - due).abs() < 5e-3, "{} {due}", track[k + 3]);
        }
    }

    /// The simulated servo: a position loop with back-EMF.
    fn servo(track: &[f64], lag_s: f64) -> Vec<f64> {
        let (mut angle, mut speed) = (track[0], 0.0);
        let steps = 20;
        let dt_s = DT / f64::from(steps);
        let servo = |goal: &f64| {
            for _ in 0..steps {
                speed += dt_s * (goal - angle - lag_s * speed) / (0.195 * lag_s * lag_s);
                angle += dt_s * speed;
            }
            angle
        };
        track.iter().map(servo).collect()
    }

    #[test]
    fn the_servo_shows_what_its_lag_would_take() {
        // Share of the power that is left, and what was left without.
        for (hz, size, least, before) in
            [(1.0, 0.2, 0.95, 0.96), (3.0, 0.04, 0.85, 0.6), (5.0, 0.02, 0.55, 0.15)]
        {
            let target = |k: usize| size * (k as f64 * DT * std::f64::consts::TAU * hz).sin();
            let power = |lag_s: f64| {
                let shown = servo(&follow_with_lag((0..900).map(target), 0.0, lag_s), 0.045);
                shown[400..900].iter().map(|v| v * v).sum::<f64>() / 250.0 / (size * size)
            };
            let (plain, undone) = (power(0.0), power(0.045));
            assert!(plain < before, "{hz} Hz: {plain}");
            assert!((least..1.1).contains(&undone), "{hz} Hz: {undone}");
        }
    }

    #[test]
    fn a_target_beyond_the_limits_is_met_in_phase() {
        for size in [0.1, 0.3, 0.6, 1.0] {
            let target = |k: f64| size * (k * DT * std::f64::consts::TAU * 2.0).sin();
            let track = follow((0..1000).map(|k| target(k as f64)), 0.0);
            let score = |delay: i32| -> f64 {
                (300..900)
                    .map(|k| track[k + 3] * target((k as i32 - AHEAD as i32 - delay).into()))
                    .sum()
            };
            let delay = (-15..=15).max_by(|a, b| score(*a).total_cmp(&score(*b))).unwrap();
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
