//! Position, velocity and acceleration limits of one joint, relative to the last
//! command: every target of every bus passes here.
//!
//! Discrete: a command moves by `v dt` each period, and `v` changes by at most
//! `a dt`. A target inside its limits passes through unchanged. Otherwise the
//! command follows as fast as the limits allow and meets the target without
//! overshoot, and never at a speed from which it could not brake before a
//! position limit. Targets must be finite: [`crate::SafeBus`] refuses others.

use servodance_types::{HeldBack, JointLimits};

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limited {
    pub position_rad: f64,
    pub position: bool,
    pub velocity: bool,
    pub acceleration: bool,
}

impl Limited {
    /// What changed the target, if anything did.
    pub fn held_back(&self) -> HeldBack {
        match (self.position, self.velocity || self.acceleration) {
            (_, true) => HeldBack::Speed,
            (true, false) => HeldBack::Limit,
            (false, false) => HeldBack::Nothing,
        }
    }
}

/// Keeps the commands of one joint inside its limits.
#[derive(Clone, Debug)]
pub struct Limiter {
    limits: JointLimits,
    period_s: f64,
    position_rad: f64,
    velocity_rad_s: f64,
    target_rad: f64,
    /// Position and velocity before the last command.
    before: (f64, f64),
}

const SLACK: f64 = 1e-6;

impl Limiter {
    /// A joint that stands still at `position_rad`.
    pub fn new(limits: JointLimits, period_s: f64, position_rad: f64) -> Self {
        Self {
            limits,
            period_s,
            position_rad,
            velocity_rad_s: 0.0,
            target_rad: position_rad,
            before: (position_rad, 0.0),
        }
    }

    /// The command of the last period, radians.
    pub fn position_rad(&self) -> f64 {
        self.position_rad
    }

    /// The last command was not sent: the next one goes on from the one before.
    pub fn take_back(&mut self) {
        (self.position_rad, self.velocity_rad_s) = self.before;
    }

    /// The command of the next period towards `target_rad`.
    pub fn step(&mut self, target_rad: f64) -> Limited {
        self.before = (self.position_rad, self.velocity_rad_s);
        let JointLimits { velocity_rad_s: fastest, acceleration_rad_s2: hardest, .. } = self.limits;
        let allowed = self.limits.clamp_rad(target_rad);
        let target_velocity = (allowed - self.target_rad) / self.period_s;
        // Close the gap that the last command left, on top of the target's own speed.
        let gap = self.target_rad - self.position_rad;
        let wanted = target_velocity + gap.signum() * self.stopping_speed(gap.abs());
        self.target_rad = allowed;

        let change = hardest * self.period_s;
        let held = wanted.clamp(-fastest, fastest);
        let eased = held.clamp(self.velocity_rad_s - change, self.velocity_rad_s + change);
        let up = self.stopping_speed(self.limits.upper_rad - self.position_rad);
        let down = self.stopping_speed(self.position_rad - self.limits.lower_rad);
        self.velocity_rad_s = eased.clamp(-down, up);
        let next = self.position_rad + self.velocity_rad_s * self.period_s;
        self.position_rad = self.limits.clamp_rad(next);
        Limited {
            position_rad: self.position_rad,
            position: (allowed - target_rad).abs() > SLACK,
            velocity: (held - wanted).abs() > SLACK * fastest,
            acceleration: (self.velocity_rad_s - held).abs() > SLACK * fastest.max(change),
        }
    }

    /// The command of the next period on the way to a standstill.
    pub fn brake(&mut self) -> f64 {
        self.before = (self.position_rad, self.velocity_rad_s);
        let change = self.limits.acceleration_rad_s2 * self.period_s;
        let slower = (self.velocity_rad_s.abs() - change).max(0.0);
        self.velocity_rad_s = slower * self.velocity_rad_s.signum();
        let next = self.position_rad + self.velocity_rad_s * self.period_s;
        self.position_rad = self.limits.clamp_rad(next);
        self.target_rad = self.position_rad;
        self.position_rad
    }

    /// The highest speed of a period after which braking still ends within
    /// `room_rad`, that period included.
    ///
    /// Braking from `v` takes n periods and covers `n v dt - a dt^2 n (n - 1) / 2`; n is the least
    /// for which `n (n + 1) / 2` steps of `a dt^2` fill the room.
    fn stopping_speed(&self, room_rad: f64) -> f64 {
        if room_rad <= 0.0 {
            return 0.0;
        }
        let step = self.limits.acceleration_rad_s2 * self.period_s * self.period_s;
        let periods = ((1.0 + 8.0 * room_rad / step).sqrt() * 0.5 - 0.5).ceil().max(1.0);
        room_rad / (periods * self.period_s)
            + self.limits.acceleration_rad_s2 * self.period_s * (periods - 1.0) * 0.5
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: JointLimits = JointLimits {
        lower_rad: -1.0,
        upper_rad: 1.5,
        velocity_rad_s: 4.0,
        acceleration_rad_s2: 40.0,
    };
    const PERIOD_S: f64 = 0.01;

    fn check(targets: impl IntoIterator<Item = f64>) -> Vec<Limited> {
        let mut limiter = Limiter::new(LIMITS, PERIOD_S, 0.0);
        let (mut last, mut speed) = (0.0, 0.0);
        let mut steps = Vec::new();
        for target in targets {
            let step = limiter.step(target);
            let now = step.position_rad;
            let velocity = (now - last) / PERIOD_S;
            assert!((-1.0..=1.5).contains(&now), "position {now}");
            assert!(velocity.abs() < 4.0 + 1e-6, "velocity {velocity}");
            let acceleration = (velocity - speed) / PERIOD_S;
            assert!(acceleration.abs() < 40.0 + 1e-5, "acceleration {acceleration}");
            (last, speed) = (now, velocity);
            steps.push(step);
        }
        steps
    }

    #[test]
    fn motion_inside_the_limits_passes_unchanged() {
        let wave = |k: usize| 0.5 * (1.0 - (4.0 * k as f64 * PERIOD_S).cos());
        for (k, step) in check((0..300).map(wave)).iter().enumerate() {
            assert!((step.position_rad - wave(k)).abs() < 1e-9, "{k}: {step:?}");
            assert!(!step.position && !step.velocity && !step.acceleration, "{k}: {step:?}");
        }
    }

    #[test]
    fn a_jump_becomes_a_fast_approach_without_overshoot() {
        let steps = check(std::iter::repeat_n(1.0, 100));
        assert!(steps.iter().all(|step| step.position_rad <= 1.0 + 1e-9));
        // Accelerate 0.1 s, brake 0.1 s, in between 0.6 rad at 4 rad/s: 0.35 s.
        assert!((steps[36].position_rad - 1.0).abs() < 1e-6, "{:?}", steps[36]);
        assert!(steps[0].acceleration);
        assert_eq!(steps[0].held_back(), HeldBack::Speed);
        assert_eq!(steps[90].held_back(), HeldBack::Nothing);
    }

    #[test]
    fn a_target_beyond_a_limit_ends_on_the_limit() {
        let steps = check(std::iter::repeat_n(9.0, 200));
        assert!(steps[199].position && (steps[199].position_rad - 1.5).abs() < 1e-9);
        assert_eq!(steps[199].held_back(), HeldBack::Limit);
    }

    #[test]
    fn braking_ends_inside_the_limits() {
        let mut limiter = Limiter::new(LIMITS, PERIOD_S, 0.0);
        for _ in 0..30 {
            limiter.step(1.5);
        }
        let before = limiter.position_rad();
        for _ in 0..12 {
            limiter.brake();
        }
        let stopped = limiter.brake();
        assert!(stopped > before && stopped <= 1.5);
        assert_eq!(limiter.brake(), stopped);
    }

    proptest! {
        #[test]
        fn commands_that_were_not_sent_leave_the_others_inside_every_limit(
            targets in prop::collection::vec((-3.0..3.0f64, any::<bool>()), 1..200),
        ) {
            let mut limiter = Limiter::new(LIMITS, PERIOD_S, 0.0);
            let (mut last, mut speed) = (0.0, 0.0);
            for (target, sent) in targets {
                let now = limiter.step(target).position_rad;
                if !sent {
                    limiter.take_back();
                    continue;
                }
                let velocity = (now - last) / PERIOD_S;
                prop_assert!((-1.0..=1.5).contains(&now) && velocity.abs() < 4.0 + 1e-6);
                prop_assert!((velocity - speed).abs() < 40.0 * PERIOD_S + 1e-6);
                (last, speed) = (now, velocity);
            }
        }

        #[test]
        fn any_targets_stay_inside_every_limit(targets in prop::collection::vec((-3.0..3.0f64, 1usize..30), 1..40)) {
            check(targets.into_iter().flat_map(|(target, times)| std::iter::repeat_n(target, times)));
        }
    }
}
