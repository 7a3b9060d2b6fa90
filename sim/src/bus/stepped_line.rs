//! Time, motors and line of one simulated bus, without any input or output.
//!
//! Time is counted in steps of at most half a millisecond that divide the
//! control period exactly, so that a run does not depend on how it is cut into calls.
//! Servos that move a robot's body get their shafts' positions from its world, at
//! the beginning of the last line step of each world step, and tell it their torques
//! after every line step.

use crate::bus::line::Line;
use crate::judge::{Judge, Violations};
use crate::world::{StepSize, WorldSeat};

#[derive(Debug)]
pub struct SteppedLine {
    pub line: Box<dyn Line>,
    seat: Option<WorldSeat>,
    steps: u64,
    size: StepSize,
    target_s: f64,
}

impl SteppedLine {
    /// A line at time zero; `period_s` is the control period, `seat` the place of its
    /// servos in a world.
    pub fn new(line: Box<dyn Line>, period_s: f64, seat: Option<WorldSeat>) -> Self {
        let size = StepSize::of(period_s);
        let mut stepped = Self { line, seat, steps: 0, size, target_s: 0.0 };
        stepped.meet_world();
        stepped
    }

    pub fn time_s(&self) -> f64 {
        self.steps as f64 * self.size.line_s
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
        let wanted = (self.target_s / self.size.line_s).round() as u64;
        while self.steps < wanted {
            self.steps += 1;
            if self.steps.is_multiple_of(self.size.steps_a_world_step) {
                self.meet_world();
            }
            let now_s = self.time_s();
            let period_ends = self.steps.is_multiple_of(self.size.steps_a_period);
            self.line.step(now_s, self.size.line_s, period_ends);
            self.tell_world();
        }
    }

    /// Until `until_s` no true motion is judged: the goals were there, and the simulation was
    /// kept from reading them.
    pub fn excuse_motion(&mut self, until_s: f64) {
        self.line.each_body(&mut |_, body| body.excuse_motion(until_s));
    }

    /// The world as it is by now; the first bus to get there moves it on.
    fn meet_world(&mut self) {
        if let Some(seat) = &mut self.seat {
            let shafts = seat.reach(self.steps / self.size.steps_a_world_step);
            self.line.each_body(&mut |index, body| {
                if let Some(shaft) = shafts.get(index) {
                    body.turn_shaft(*shaft);
                }
            });
        }
    }

    fn tell_world(&mut self) {
        if let Some(seat) = &mut self.seat {
            let line = &mut self.line;
            seat.tell(|drives| {
                line.each_body(&mut |index, body| {
                    if let Some(drive) = drives.get_mut(index) {
                        *drive = body.shaft_drive();
                    }
                });
            });
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
