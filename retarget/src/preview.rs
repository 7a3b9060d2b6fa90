//! Which acceleration now, when the target's next moments are known.
//!
//! A joint that is slower than its target either lags behind it, or looks ahead
//! and takes the corner on the inside. This looks ahead: three tenths of a second of
//! accelerations, constant over blocks that grow with distance, minimises the
//! squared distance to the known targets inside the acceleration limit; only the
//! first one is used, and the plan is made anew every cycle (model predictive
//! control with move blocking). Small changes of acceleration cost a little, so
//! that noise is not followed.

use crate::solver::Solver;

/// How far the plan reaches, seconds.
pub(crate) const PREVIEW_S: f64 = 0.3;
/// Lengths of the blocks, in twentieths of the plan.
const BLOCKS: [usize; 8] = [1, 1, 2, 2, 3, 3, 4, 4];
/// Radians of distance that a change of acceleration by 1 rad/s^2 is worth.
const SMOOTHNESS: f64 = 3e-4;
/// Radians of distance that 1 rad/s of wrong speed at the end is worth.
const END_SPEED: f64 = 0.03;

/// Plans for one joint; remembers which limits held the last plan.
pub(crate) struct Preview {
    dt_s: f64,
    /// Position after each cycle by the acceleration of each block.
    response: Vec<[f64; BLOCKS.len()]>,
    end_speed: [f64; BLOCKS.len()],
    solver: Solver,
}

impl Preview {
    pub fn new(dt_s: f64) -> Self {
        let cycles = ((PREVIEW_S / dt_s).round() as usize).max(BLOCKS.len());
        let block_of = block_of_cycles(cycles);
        let mut response = Vec::with_capacity(cycles);
        let mut speed = [0.0; BLOCKS.len()];
        let mut place = [0.0; BLOCKS.len()];
        for block in block_of {
            speed[block] += dt_s;
            for (place, speed) in place.iter_mut().zip(&speed) {
                *place += speed * dt_s;
            }
            response.push(place);
        }
        let mut solver = Solver::new(BLOCKS.len());
        let share = (1.0 / cycles as f64).sqrt();
        for row in &response {
            solver.add_row(share, row);
        }
        solver.add_row(END_SPEED, &speed);
        for block in 0..BLOCKS.len() {
            let mut change = [0.0; BLOCKS.len()];
            change[block] = 1.0;
            if block > 0 {
                change[block - 1] = -1.0;
            }
            solver.add_row(SMOOTHNESS, &change);
        }
        Self {
            dt_s,
            response,
            end_speed: speed,
            solver,
        }
    }

    /// Cycles that the plan reaches.
    pub fn cycles(&self) -> usize {
        self.response.len()
    }

    /// The acceleration for the next cycle. `targets` are the positions wanted
    /// after each of the next cycles; `state` is position, velocity and last
    /// acceleration.
    pub fn acceleration(
        &mut self,
        state: [f64; 3],
        targets: impl Iterator<Item = f64>,
        most: f64,
    ) -> f64 {
        let [position, velocity, acceleration] = state;
        let share = 1.0 / self.response.len() as f64;
        let mut slope = [0.0; BLOCKS.len()];
        let (mut last, mut last_speed) = (position, 0.0);
        for (cycle, (row, target)) in self.response.iter().zip(targets).enumerate() {
            let coasting = position + (cycle + 1) as f64 * velocity * self.dt_s;
            for (slope, part) in slope.iter_mut().zip(row) {
                *slope -= share * part * (target - coasting);
            }
            last_speed = (target - last) / self.dt_s;
            last = target;
        }
        for (slope, part) in slope.iter_mut().zip(&self.end_speed) {
            *slope -= END_SPEED * END_SPEED * part * (last_speed - velocity);
        }
        slope[0] -= SMOOTHNESS * SMOOTHNESS * acceleration;
        self.solver.set_slope(&slope);
        let plan = self
            .solver
            .solve(&[-most; BLOCKS.len()], &[most; BLOCKS.len()]);
        plan[0]
    }
}

/// The block that each cycle belongs to.
fn block_of_cycles(cycles: usize) -> impl Iterator<Item = usize> {
    let total: usize = BLOCKS.iter().sum();
    (0..cycles).map(move |cycle| {
        let place = cycle * total / cycles;
        let mut end = 0;
        BLOCKS
            .iter()
            .position(|length| {
                end += length;
                place < end
            })
            .unwrap_or(BLOCKS.len() - 1)
    })
}
