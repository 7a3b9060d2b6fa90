//! What one joint may do next, so that it can keep every limit for ever after.
//!
//! Velocity, acceleration and jerk are what a servo would see: first, second and
//! third differences of successive positions over the cycle time. A state is
//! *safe* if coming to a standstill from it, by one fixed law, stays inside
//! every limit all the way. One cycle of a safe stop leads to a safe state (the
//! rest of the same stop), so from a safe state there always is a safe next one:
//! limits never contradict each other and nothing ever has to give way. The
//! stop is computed cycle by cycle with the very arithmetic that later executes
//! it; braking distances are therefore exact at every control rate, not
//! formulas for continuous time.

use servodance_types::JointLimits;

/// Halvings of the jerk between stopping and what was wanted.
const HALVINGS: usize = 14;
/// Slower than this is a standstill, radians a second.
const STILL_RAD_S: f64 = 1e-9;

/// Where a joint is and what it does there; radians and seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TrajectoryState {
    pub position: f64,
    pub velocity: f64,
    pub acceleration: f64,
}

impl TrajectoryState {
    pub fn at_rest(position: f64) -> Self {
        Self { position, velocity: 0.0, acceleration: 0.0 }
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct JointLimiter {
    pub limits: JointLimits,
    pub jerk_rad_s3: f64,
    pub dt_s: f64,
}

impl JointLimiter {
    pub fn next(&self, state: &TrajectoryState, jerk: f64) -> TrajectoryState {
        let acceleration = state.acceleration + jerk * self.dt_s;
        let velocity = state.velocity + acceleration * self.dt_s;
        TrajectoryState { position: state.position + velocity * self.dt_s, velocity, acceleration }
    }

    /// The next state on the way to a steady `velocity`, inside the limits of
    /// acceleration and jerk; a standstill is the steady velocity 0.
    pub fn steady(&self, state: &TrajectoryState, velocity: f64) -> TrajectoryState {
        self.next(state, self.steady_jerk(state, velocity))
    }

    /// The time-optimal way to a velocity for jerk in steps of a cycle, that
    /// arrives without chattering (Han 1999, discrete double integrator).
    fn steady_jerk(&self, state: &TrajectoryState, velocity: f64) -> f64 {
        let (most, dt) = (self.jerk_rad_s3, self.dt_s);
        let left = state.velocity - velocity;
        let step = most * dt;
        let slope = if left.abs() > step * dt {
            let root = (step * step + 8.0 * most * left.abs()).sqrt();
            state.acceleration + (root - step) / 2.0 * left.signum()
        } else {
            state.acceleration + left / dt
        };
        let jerk = -most * (slope / step).clamp(-1.0, 1.0);
        self.inside(state, jerk)
    }

    /// `jerk` held inside its limit and the acceleration's.
    fn inside(&self, state: &TrajectoryState, jerk: f64) -> f64 {
        let most = self.limits.acceleration_rad_s2;
        let low = ((-most - state.acceleration) / self.dt_s).max(-self.jerk_rad_s3);
        let high = ((most - state.acceleration) / self.dt_s).min(self.jerk_rad_s3);
        // An acceleration beyond the limit comes back as fast as jerk allows.
        jerk.max(low.min(self.jerk_rad_s3)).min(high.max(-self.jerk_rad_s3))
    }

    /// The safe next state nearest to being at `position`.
    pub fn toward(&self, state: &TrajectoryState, position: f64) -> TrajectoryState {
        let velocity = (position - state.position) / self.dt_s;
        let acceleration = (velocity - state.velocity) / self.dt_s;
        let wanted = (acceleration - state.acceleration) / self.dt_s;
        self.safest(state, self.inside(state, wanted))
    }

    /// The safe next states with the lowest and the highest position.
    pub fn reach(&self, state: &TrajectoryState) -> [TrajectoryState; 2] {
        [-self.jerk_rad_s3, self.jerk_rad_s3]
            .map(|jerk| self.safest(state, self.inside(state, jerk)))
    }

    /// The safe state nearest to the one that `wanted` leads to, on the way to
    /// the one that stopping leads to.
    fn safest(&self, state: &TrajectoryState, wanted: f64) -> TrajectoryState {
        let next = self.next(state, wanted);
        if self.is_safe(&next) {
            return next;
        }
        let stop = self.steady_jerk(state, 0.0);
        let (mut safe, mut unsafe_share) = (0.0, 1.0);
        let mut best = self.next(state, stop);
        for _ in 0..HALVINGS {
            let share = f64::midpoint(safe, unsafe_share);
            let next = self.next(state, stop + share * (wanted - stop));
            if self.is_safe(&next) {
                (safe, best) = (share, next);
            } else {
                unsafe_share = share;
            }
        }
        best
    }

    /// Whether a stop from `state` stays inside every limit.
    pub fn is_safe(&self, state: &TrajectoryState) -> bool {
        self.is_plainly_safe(state) || self.stops_inside(state)
    }

    /// Whether no stop, however clumsy, could meet a limit: spares most joints
    /// the look ahead. Bounds of the time and the speed that a stop takes.
    fn is_plainly_safe(&self, state: &TrajectoryState) -> bool {
        let JointLimits { lower_rad, upper_rad, velocity_rad_s, acceleration_rad_s2: brake } =
            self.limits;
        let push = state.acceleration.abs();
        let rise_s = push / self.jerk_rad_s3 + 2.0 * self.dt_s;
        let fastest = state.velocity.abs() + push * rise_s;
        let time_s = rise_s
            + fastest / brake
            + 2.0 * (fastest / self.jerk_rad_s3).sqrt()
            + 2.0 * brake / self.jerk_rad_s3
            + 4.0 * self.dt_s;
        let farthest = fastest * time_s;
        push <= brake
            && fastest <= velocity_rad_s
            && state.position + farthest <= upper_rad
            && state.position - farthest >= lower_rad
    }

    fn stops_inside(&self, state: &TrajectoryState) -> bool {
        let JointLimits { lower_rad, upper_rad, velocity_rad_s, acceleration_rad_s2 } = self.limits;
        let mut now = *state;
        for _ in 0..self.most_cycles() {
            let inside = (lower_rad..=upper_rad).contains(&now.position)
                && now.velocity.abs() <= velocity_rad_s
                && now.acceleration.abs() <= acceleration_rad_s2 * (1.0 + 1e-12);
            if !inside {
                return false;
            }
            let still = now.velocity.abs() <= STILL_RAD_S
                && now.acceleration.abs() * self.dt_s <= STILL_RAD_S;
            if still {
                return true;
            }
            now = self.steady(&now, 0.0);
        }
        false
    }

    /// More cycles than any stop from inside the limits takes.
    fn most_cycles(&self) -> usize {
        let JointLimits { velocity_rad_s: speed, acceleration_rad_s2: brake, .. } = self.limits;
        let rise_s = brake / self.jerk_rad_s3;
        let time_s = speed / brake + 3.0 * rise_s + 2.0 * (speed / self.jerk_rad_s3).sqrt();
        (time_s / self.dt_s).min(1e5) as usize + 16
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn limiter() -> impl Strategy<Value = JointLimiter> {
        let rates = (0.3..12.0_f64, 2.0..100.0_f64, 0.005..0.2_f64, 20.0..600.0_f64);
        (-3.0..0.5_f64, 0.005..4.0_f64, rates).prop_map(|(low, range, (v, a, rise, hz))| {
            JointLimiter {
                limits: JointLimits {
                    lower_rad: low,
                    upper_rad: low + range,
                    velocity_rad_s: v,
                    acceleration_rad_s2: a,
                },
                jerk_rad_s3: a / rise,
                dt_s: 1.0 / hz,
            }
        })
    }

    /// Written from the definition of the limits alone: differences of positions.
    fn violations(track: &[f64], limiter: &JointLimiter) -> [usize; 4] {
        let differences = |values: &[f64]| -> Vec<f64> {
            values.windows(2).map(|pair| (pair[1] - pair[0]) / limiter.dt_s).collect()
        };
        let velocity = differences(track);
        let acceleration = differences(&velocity);
        let jerk = differences(&acceleration);
        let limits = &limiter.limits;
        let beyond = |values: &[f64], most: f64, noise: f64| {
            values.iter().filter(|v| v.abs() > most + noise).count()
        };
        let hz = 1.0 / limiter.dt_s;
        [
            track.iter().filter(|p| !(limits.lower_rad..=limits.upper_rad).contains(*p)).count(),
            beyond(&velocity, limits.velocity_rad_s, 1e-14 * hz),
            beyond(&acceleration, limits.acceleration_rad_s2, 1e-14 * hz * hz),
            beyond(&jerk, limiter.jerk_rad_s3, 1e-14 * hz * hz * hz),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        /// Any wish, any limits, any rate: no limit is ever broken.
        #[test]
        fn no_wish_breaks_a_limit(
            limiter in limiter(),
            wishes in prop::collection::vec((-4.0..4.0_f64, 1..30_usize), 1..30),
            start in 0.0..1.0_f64,
        ) {
            let JointLimits { lower_rad, upper_rad, .. } = limiter.limits;
            let start = (lower_rad + start * (upper_rad - lower_rad)).clamp(lower_rad, upper_rad);
            let mut state = TrajectoryState::at_rest(start);
            let mut track = vec![start; 3];
            for (wish, cycles) in wishes {
                for _ in 0..cycles {
                    state = limiter.toward(&state, wish);
                    track.push(state.position);
                }
            }
            prop_assert_eq!(violations(&track, &limiter), [0; 4]);
        }

        #[test]
        fn what_looks_safe_is_safe(
            limiter in limiter(),
            place in 0.0..1.0_f64, speed in -1.0..1.0_f64, push in -1.0..1.0_f64,
        ) {
            let limits = limiter.limits;
            let state = TrajectoryState {
                position: limits.lower_rad + place * (limits.upper_rad - limits.lower_rad),
                velocity: speed * limits.velocity_rad_s,
                acceleration: push * limits.acceleration_rad_s2,
            };
            prop_assert!(!limiter.is_plainly_safe(&state) || limiter.stops_inside(&state));
        }

        #[test]
        fn a_stop_ends(limiter in limiter(), speed in -1.0..1.0_f64, push in -1.0..1.0_f64) {
            let mut state = TrajectoryState {
                position: 0.0,
                velocity: speed * limiter.limits.velocity_rad_s,
                acceleration: push * limiter.limits.acceleration_rad_s2,
            };
            for _ in 0..limiter.most_cycles() {
                state = limiter.steady(&state, 0.0);
            }
            prop_assert!(state.velocity.abs() < 1e-9, "{:?}", state);
        }
    }
}
