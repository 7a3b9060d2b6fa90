//! Which acceleration now, when the target's next moments are known.
//!
//! A joint that is slower than its target either lags behind it, or looks ahead
//! and takes the corner on the inside. This looks ahead: some tenths of a second
//! of accelerations, constant over blocks that grow with distance, minimise the
//! squared distance to the known targets inside the acceleration limit and
//! inside what the jerk limit lets each block reach; only the first one is used,
//! and the plan is made anew every cycle (model predictive control with move
//! blocking). Small changes of acceleration cost a little, so that noise is not
//! followed.
use crate::limits::{JointLimiter, TrajectoryState};
use crate::solver::BoxLeastSquares;

const BLOCKS: [usize; 8] = [1, 1, 2, 2, 3, 3, 4, 4];
/// Radians of distance that a change of acceleration by 1 rad/s^2 is worth: calm, and
/// where a dancer's accents are to be shown (at 5 Hz a third of the former's loss).
pub(super) const CALM: f64 = 3e-4;
pub(super) const SHARP: f64 = 1e-4;
/// Radians of distance that 1 rad/s of wrong speed at the end is worth.
const END_SPEED: f64 = 0.03;

/// Plans for one joint; remembers which limits held the last plan.
pub(crate) struct PredictiveController {
    dt_s: f64,
    /// Position after each cycle by the acceleration of each block.
    response: Vec<[f64; BLOCKS.len()]>,
    end_speed: [f64; BLOCKS.len()],
    /// Seconds until the middle of each block.
    middle_s: [f64; BLOCKS.len()],
    smoothness: f64,
    solver: BoxLeastSquares,
}

impl PredictiveController {
    /// For targets that are known `preview_s` ahead; [`CALM`] or [`SHARP`].
    pub fn new(dt_s: f64, preview_s: f64, smoothness: f64) -> Self {
        let cycles = ((preview_s / dt_s).round() as usize).max(BLOCKS.len());
        let block_of = block_of_cycles(cycles);
        let mut response = Vec::with_capacity(cycles);
        let mut speed = [0.0; BLOCKS.len()];
        let mut place = [0.0; BLOCKS.len()];
        let mut middle_s = [0.0; BLOCKS.len()];
        let mut past_s = 0.0;
        for block in block_of {
            past_s += dt_s;
            middle_s[block] = past_s - speed[block] / 2.0;
            speed[block] += dt_s;
            for (place, speed) in place.iter_mut().zip(&speed) {
                *place += speed * dt_s;
            }
            response.push(place);
        }
        let mut solver = BoxLeastSquares::new(BLOCKS.len());
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
            solver.add_row(smoothness, &change);
        }
        Self { dt_s, response, end_speed: speed, middle_s, smoothness, solver }
    }

    pub fn cycles(&self) -> usize {
        self.response.len()
    }

    pub fn work(&self) -> u64 {
        self.solver.work
    }

    /// The acceleration for the next cycle. `targets` are the positions wanted
    /// after each of the next cycles.
    pub fn acceleration(
        &mut self,
        limiter: &JointLimiter,
        state: &TrajectoryState,
        targets: impl Iterator<Item = f64>,
    ) -> f64 {
        let TrajectoryState { position, velocity, acceleration } = *state;
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
        slope[0] -= self.smoothness * self.smoothness * acceleration;
        self.solver.set_gradient(&slope);
        let most = limiter.limits.acceleration_rad_s2;
        let reach = |sign: f64| {
            self.middle_s.map(|after_s| {
                (acceleration + sign * limiter.jerk_rad_s3 * after_s).clamp(-most, most)
            })
        };
        let (low, high) = (reach(-1.0), reach(1.0));
        let plan = self.solver.solve(&low, &high);
        // A later change takes time to build up: it is begun before.
        let last = BLOCKS.len() - 1;
        let mut next = plan[last];
        for block in (0..last).rev() {
            let between_s = self.middle_s[block + 1] - self.middle_s[block];
            let change = limiter.jerk_rad_s3 * between_s;
            next = plan[block].clamp(next - change, next + change);
        }
        next
    }
}

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
