//! How a control period is cut: into steps of the servos' lines, and those into
//! groups that are one step of the world.

use super::LONGEST_STEP_S;

/// Longest step of the motors, seconds.
const LONGEST_LINE_STEP_S: f64 = 0.5e-3;

/// Steps that divide a control period exactly, so that a run does not depend on how
/// it is cut into calls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepSize {
    /// Steps of a line in a control period.
    pub steps_a_period: u64,
    /// One of them, seconds.
    pub line_s: f64,
    /// Steps of a line in one step of the world.
    pub steps_a_world_step: u64,
}

impl StepSize {
    /// Cuts a control period of so many seconds.
    pub fn of(period_s: f64) -> Self {
        let steps = (period_s / LONGEST_LINE_STEP_S).ceil().max(1.0);
        let line_s = period_s / steps;
        let steps_a_period = steps as u64;
        let fits = |many: &u64| *many as f64 * line_s <= LONGEST_STEP_S * (1.0 + 1e-9);
        let divides = |many: &u64| steps_a_period.is_multiple_of(*many);
        let steps_a_world_step =
            (1..=steps_a_period).take_while(fits).filter(divides).last().unwrap_or(1);
        Self { steps_a_period, line_s, steps_a_world_step }
    }

    /// One step of the world, seconds.
    pub fn world_s(&self) -> f64 {
        self.line_s * self.steps_a_world_step as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn world_steps_divide_the_period_and_are_at_most_2_ms() {
        for (hz, line, world) in
            [(100.0, 20, 4), (250.0, 8, 4), (125.0, 16, 4), (60.0, 34, 2), (90.0, 23, 1)]
        {
            let size = StepSize::of(1.0 / hz);
            assert_eq!((size.steps_a_period, size.steps_a_world_step), (line, world), "{hz} Hz");
            assert!(size.world_s() <= LONGEST_STEP_S + 1e-12);
        }
    }
}
