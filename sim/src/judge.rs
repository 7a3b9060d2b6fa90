//! Whether a servo stays inside its joint's limits, judged at the servo itself.
//!
//! Two things are judged while torque is on: its **goals** (each goal
//! position, and the first and second difference of consecutive goals, one goal
//! a control period) and its **motion** (true position at every control
//! period, and its differences: velocity and acceleration averaged over one
//! period).
//!
//! The only allowance is rounding to encoder ticks, half a tick for each goal
//! that enters: half a tick of position, one tick a period of velocity
//! (1/2 + 1/2), two ticks a period squared of acceleration (1/2 + 2/2 + 1/2).
//! A motor without overshoot that follows goals inside these bounds stays
//! inside them, so the same allowance holds for the true motion.
//!
//! A goal that the simulated wire loses or damages makes the next one a double step,
//! although the host did nothing wrong: that one is judged by how many goals the host has
//! sent since the last one that arrived, and by the time in which it did.
//!
//! A shaft that stood beyond a limit as torque came on (it coasted there, or a hand put it
//! there) may come in; further out it must not go.
//!
//! Not judged: torque off, a shaft that something holds, the emergency stop of the servo's own
//! watchdog, in a world the true motion while something pushes the robot or it has fallen, and
//! in real time the true motion during and just after a time in which the machine kept the
//! simulation from running: goals that came meanwhile are read together and late.

use std::f64::consts::TAU;

use servodance_types::JointLimits;

/// Limits broken, counted once for every servo and control period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)] // the names say it
pub struct Violations {
    pub position: u64,
    pub velocity: u64,
    pub acceleration: u64,
}

impl Violations {
    /// The sum over all three limits.
    pub fn total(&self) -> u64 {
        self.position + self.velocity + self.acceleration
    }
}

impl std::ops::AddAssign for Violations {
    fn add_assign(&mut self, other: Self) {
        self.position += other.position;
        self.velocity += other.velocity;
        self.acceleration += other.acceleration;
    }
}

const NOTES: usize = 8;
/// More lost goals in a row than this are not taken into account.
const MOST_LOST: u32 = 20;
/// Copies of one packet come within so much of a control period.
const REPEATED_PERIODS: f64 = 0.9;
/// Goals may come so much of a control period closer than they should.
const JITTER_PERIODS: f64 = 0.5;
const RAD_PER_TICK: f64 = TAU / 4096.0;
const NOISE_RAD: f64 = 1e-9; // of floating-point numbers

#[derive(Clone, Debug)]
pub struct Judge {
    name: String,
    limits: JointLimits,
    period_s: f64,
    goals: JudgedTrack,
    pub motion: JudgedTrack,
    pub notes: Vec<String>,
    pub tick_rad: f64,
    /// The packet that just arrived came before, with none in between, so long ago on the
    /// wire: copies of one packet are no goals of their own.
    pub repeated_after_s: Option<f64>,
}

#[derive(Clone, Debug, Default)]
pub struct JudgedTrack {
    /// Goals that the host sent since the last one that arrived, where the wire has a fault.
    sent: u32,
    /// When the last one came, seconds.
    last_s: f64,
    /// Goals whose acceleration is still measured across lost ones.
    across: u32,
    /// How far beyond a limit it stood as torque came on, or has come in to since, radians.
    beyond_rad: f64,
    /// The last one and the one before, radians; `None` while it is not judged.
    pub last: Option<(f64, f64)>,
    pub violations: Violations,
}

/// What a position is judged by: what lies between it and the last one, in control periods.
#[derive(Clone, Copy, Debug)]
struct Span {
    /// How many steps of the host they are apart.
    periods: f64,
    /// How many periods they had for that.
    passed: f64,
    /// How many periods the change of their velocity has.
    across: f64,
    /// How far beyond a limit is no fault of the servo's, radians.
    beyond_rad: f64,
}

impl Default for Span {
    fn default() -> Self {
        Self { periods: 1.0, passed: 1.0, across: 1.0, beyond_rad: 0.0 }
    }
}

impl JudgedTrack {
    fn follow(&mut self, now_rad: f64, broken: Violations) {
        self.violations += broken;
        self.last = self.last.map(|(last_rad, _)| (now_rad, last_rad));
    }
}

impl Judge {
    /// A judge for one joint; `period_s` is the control period.
    pub fn new(name: &str, limits: JointLimits, period_s: f64) -> Self {
        Self {
            name: name.into(),
            limits,
            period_s,
            goals: JudgedTrack::default(),
            motion: JudgedTrack::default(),
            notes: Vec::new(),
            tick_rad: RAD_PER_TICK,
            repeated_after_s: None,
        }
    }

    /// Torque comes on: judges from here on, at rest at `goal_rad` and `position_rad`.
    pub fn begin(&mut self, goal_rad: f64, position_rad: f64) {
        self.goals.last = Some((goal_rad, goal_rad));
        self.motion.last = Some((position_rad, position_rad));
        self.motion.beyond_rad = self.beyond_rad(position_rad);
    }

    fn beyond_rad(&self, position_rad: f64) -> f64 {
        let limits = &self.limits;
        (limits.lower_rad - position_rad).max(position_rad - limits.upper_rad).max(0.0)
    }

    /// Torque goes off: nothing is judged until the next [`Judge::begin`].
    pub fn end(&mut self) {
        self.goals.last = None;
        self.motion.last = None;
    }

    /// The host sends a goal to a wire that may lose it.
    pub fn send_goal(&mut self) {
        self.goals.sent += 1;
    }

    pub fn judge_goal(&mut self, time_s: f64, goal_rad: f64) {
        let is_copy = |after_s: f64| after_s < REPEATED_PERIODS * self.period_s;
        if self.repeated_after_s.is_some_and(is_copy) {
            return;
        }
        let sent = std::mem::take(&mut self.goals.sent).clamp(1, MOST_LOST);
        if sent > 1 {
            self.goals.across = 1 + sent;
        }
        let periods = f64::from(sent);
        let passed = (time_s - self.goals.last_s) / self.period_s + JITTER_PERIODS;
        let span = Span {
            periods,
            passed: passed.clamp(1.0, periods),
            across: f64::from(self.goals.across.max(1)),
            beyond_rad: 0.0,
        };
        self.goals.last_s = time_s;
        let broken = self.judge(self.goals.last, time_s, goal_rad, "was told", span);
        let last_rad = self.goals.last.map_or(goal_rad, |(last_rad, _)| last_rad);
        self.goals.follow(goal_rad, broken);
        if let Some((now_rad, before_rad)) = &mut self.goals.last {
            // The step of one period.
            *before_rad = *now_rad - (*now_rad - last_rad) / periods;
        }
        self.goals.across = self.goals.across.saturating_sub(1);
    }

    pub fn judge_motion(&mut self, time_s: f64, position_rad: f64) {
        let span = Span { beyond_rad: self.motion.beyond_rad, ..Span::default() };
        let broken = self.judge(self.motion.last, time_s, position_rad, "went", span);
        self.motion.beyond_rad = self.motion.beyond_rad.min(self.beyond_rad(position_rad));
        self.motion.follow(position_rad, broken);
    }

    /// The same position, moved by something that the servo cannot help.
    pub fn pass_motion(&mut self, position_rad: f64) {
        self.motion.follow(position_rad, Violations::default());
    }

    /// The limits that a step from the `last` two positions breaks.
    fn judge(
        &mut self,
        last: Option<(f64, f64)>,
        time_s: f64,
        now_rad: f64,
        verb: &str,
        Span { periods, passed, across, beyond_rad }: Span,
    ) -> Violations {
        let mut broken = Violations::default();
        let Some((last_rad, before_rad)) = last else {
            return broken;
        };
        let limits = self.limits;
        let half = self.tick_rad / 2.0 + NOISE_RAD;
        if self.beyond_rad(now_rad) > beyond_rad + half {
            broken.position = 1;
            let range = format!("{:.4} to {:.4} rad", limits.lower_rad, limits.upper_rad);
            self.note(time_s, verb, format!("to {now_rad:.4} rad, limit {range}"));
        }
        let moved = now_rad - last_rad;
        if moved.abs() > limits.velocity_rad_s * self.period_s * passed + 2.0 * half {
            broken.velocity = 1;
            let velocity = moved / (self.period_s * passed);
            let limit = limits.velocity_rad_s;
            let what = format!("at {velocity:.3} rad/s, limit {limit:.3}");
            self.note(time_s, verb, what);
        }
        let turned = moved / periods - (last_rad - before_rad);
        let allowed = limits.acceleration_rad_s2 * self.period_s * self.period_s * across;
        if turned.abs() > allowed + 4.0 * half {
            broken.acceleration = 1;
            let acceleration = turned / (self.period_s * self.period_s);
            let limit = limits.acceleration_rad_s2;
            let what = format!("with {acceleration:.1} rad/s2, limit {limit:.1}");
            self.note(time_s, verb, what);
        }
        broken
    }

    fn note(&mut self, time_s: f64, verb: &str, what: String) {
        if self.notes.len() < NOTES {
            let name = &self.name;
            self.notes.push(format!("{time_s:.3} s: {name} {verb} {what}"));
        }
    }

    pub fn violations(&self) -> Violations {
        let mut sum = self.goals.violations;
        sum += self.motion.violations;
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 0.01;
    const LIMITS: JointLimits = JointLimits {
        lower_rad: -1.0,
        upper_rad: 1.0,
        velocity_rad_s: 4.0,
        acceleration_rad_s2: 40.0,
    };

    fn judged(goals: &[f64]) -> Violations {
        let mut judge = Judge::new("elbow", LIMITS, PERIOD_S);
        judge.begin(goals[0], goals[0]);
        for (k, goal) in goals.iter().enumerate().skip(1) {
            judge.judge_goal(k as f64 * PERIOD_S, *goal);
        }
        judge.violations()
    }

    fn run(acceleration: f64, top: f64) -> Vec<f64> {
        let (mut position, mut speed) = (-0.99, 0.0);
        let mut goals = vec![position];
        while position < 0.7 {
            speed = f64::min(speed + acceleration * PERIOD_S, top);
            position += speed * PERIOD_S;
            goals.push((position / RAD_PER_TICK).round() * RAD_PER_TICK);
        }
        goals
    }

    #[test]
    fn motion_at_every_limit_rounded_to_ticks_is_clean() {
        assert_eq!(judged(&run(40.0, 4.0)), Violations::default());
    }

    #[test]
    fn goals_that_the_wire_lost_are_judged_by_how_many_they_were_and_the_time_that_passed() {
        let goals = run(40.0, 4.0);
        let judged = |told: bool, stretch: f64| {
            let mut judge = Judge::new("elbow", LIMITS, PERIOD_S);
            judge.begin(goals[0], goals[0]);
            for (k, goal) in goals.iter().enumerate().skip(1) {
                if told {
                    judge.send_goal();
                }
                if k % 7 != 3 && k % 11 != 4 {
                    judge.judge_goal(k as f64 * PERIOD_S * stretch, *goal);
                }
            }
            judge.violations()
        };
        assert_eq!(judged(true, 1.0).total(), 0);
        assert_eq!(judged(true, 1.5).total(), 0, "a host that is slow");
        assert!(judged(true, 0.5).velocity > 0, "a host whose goals bunch up");
        assert!(judged(false, 1.0).total() > 0, "a host that leaves goals out");
    }

    #[test]
    fn copies_of_a_goal_are_none_of_their_own_however_late_the_simulation_comes_to_them() {
        let moving_with_copies = |copied_after_s: f64| {
            let mut judge = Judge::new("elbow", LIMITS, PERIOD_S);
            judge.begin(0.0, 0.0);
            for (k, goal) in [0.004, 0.012, 0.024].into_iter().enumerate() {
                let time_s = 3.0 * k as f64 * PERIOD_S;
                judge.repeated_after_s = None;
                judge.judge_goal(time_s, goal);
                judge.repeated_after_s = Some(copied_after_s);
                judge.judge_goal(time_s + 1.5 * PERIOD_S, goal);
            }
            judge.violations()
        };
        assert_eq!(moving_with_copies(0.1 * PERIOD_S).total(), 0);
        assert!(moving_with_copies(PERIOD_S).acceleration > 0, "a host that stands still");
    }

    #[test]
    fn a_shaft_that_stood_outside_as_torque_came_on_may_come_in_and_not_go_out() {
        let judged = |positions: &[f64]| {
            let mut judge = Judge::new("elbow", LIMITS, PERIOD_S);
            judge.begin(-1.0, positions[0]);
            for (k, position) in positions.iter().enumerate() {
                judge.judge_motion(k as f64 * PERIOD_S, *position);
            }
            judge.violations().position
        };
        assert_eq!(judged(&[-1.01, -1.01, -1.007, -1.004, -1.0, -0.998]), 0);
        assert_eq!(judged(&[-1.01, -1.011]), 1, "further out");
        assert_eq!(judged(&[-1.01, -1.004, -1.008]), 1, "out again");
        assert_eq!(judged(&[-1.01, -0.999, -1.004]), 1, "inside, then out");
        assert_eq!(judged(&[-0.999, -1.004]), 1, "it stood inside");
    }

    #[test]
    fn each_limit_can_be_broken_alone() {
        let speeding = judged(&run(40.0, 4.4));
        assert!(speeding.velocity > 0 && speeding.position + speeding.acceleration == 0);
        let jerky = judged(&run(100.0, 4.0));
        assert!(jerky.acceleration > 0 && jerky.position + jerky.velocity == 0);
        let outside = judged(&[1.0, 1.001]);
        assert!(outside.position == 1 && outside.total() == 1, "{outside:?}");
    }

    #[test]
    fn nothing_is_judged_without_torque() {
        let mut judge = Judge::new("elbow", LIMITS, PERIOD_S);
        judge.judge_motion(0.0, 3.0);
        judge.begin(0.0, 0.0);
        judge.end();
        judge.judge_goal(0.0, 3.0);
        assert_eq!(judge.violations().total(), 0);
    }
}
