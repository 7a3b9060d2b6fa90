//! Time, motors and line of one simulated bus, without any input or output.
//!
//! Time is counted in steps of at most half a millisecond that divide the
//! control period exactly, so that a run does not depend on how it is cut into calls.

use crate::bus::line::Line;
use crate::judge::{Judge, Violations};

/// Longest step of the motors, seconds.
const LONGEST_STEP_S: f64 = 0.5e-3;

#[derive(Debug)]
pub struct World {
    pub line: Box<dyn Line>,
    steps: u64,
    steps_a_period: u64,
    step_s: f64,
    target_s: f64,
}

impl World {
    /// A world at time zero; `period_s` is the control period.
    pub fn new(line: Box<dyn Line>, period_s: f64) -> Self {
        let steps_a_period = (period_s / LONGEST_STEP_S).ceil().max(1.0);
        Self {
            line,
            steps: 0,
            steps_a_period: steps_a_period as u64,
            step_s: period_s / steps_a_period,
            target_s: 0.0,
        }
    }

    pub fn time_s(&self) -> f64 {
        self.steps as f64 * self.step_s
    }

    /// Moves time on by `dt_s`; what is less than a step is kept for the next call.
    pub fn advance(&mut self, dt_s: f64) {
        if dt_s.is_finite() && dt_s > 0.0 {
            self.advance_to(self.target_s + dt_s);
        }
    }

    /// Moves time on to `time_s`, to the nearest whole step.
    pub fn advance_to(&mut self, time_s: f64) {
        self.target_s = self.target_s.max(time_s);
        let wanted = (self.target_s / self.step_s).round() as u64;
        while self.steps < wanted {
            self.steps += 1;
            let now_s = self.time_s();
            let period_ends = self.steps.is_multiple_of(self.steps_a_period);
            self.line.step(now_s, self.step_s, period_ends);
        }
    }

    pub fn sum(&self, count: impl Fn(&Judge) -> Violations) -> Violations {
        let mut sum = Violations::default();
        for judge in self.line.judges() {
            sum += count(judge);
        }
        sum
    }
}
