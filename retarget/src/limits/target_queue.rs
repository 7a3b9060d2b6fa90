//! Targets of one joint that wait to be due, and what a servo has to be told so that it
//! shows them.
//!
//! A servo's position loop against its back-EMF follows a goal as `1 / (1 + lag s + share
//! lag^2 s^2)`: slow movement comes `lag` late, quick movement is flattened as well. The
//! inverse of that, applied to targets that are known ahead and then delayed by the lag,
//! leaves the lateness (which motion is sent ahead for) and gives the quick movement back.

use std::collections::VecDeque;

/// Square of the servo's natural period over its lag: rotor inertia over stiffness, of a
/// loop whose stock gain is slightly overdamped.
const INERTIA_SHARE: f64 = 0.195;
/// Derivatives are taken over so many cycles on either side: noise of a solver is not a hit.
const REACH: usize = 2;

pub(super) struct TargetQueue {
    /// Oldest first; as many more than are planned for as the lag and both sides need.
    targets: VecDeque<f64>,
    cycles: usize,
    /// Weights of the target before, at and after a moment.
    weights: [f64; 3],
    /// Cycles from a target to the command for it; `None`: the target is the command.
    late: Option<usize>,
}

impl TargetQueue {
    /// `cycles` targets that wait, all equal.
    pub fn new(cycles: usize, servo_lag_s: f64, dt_s: f64, first: f64) -> Self {
        let lag_cycles = (servo_lag_s / dt_s).round() as usize;
        // A lag of less than a derivative's reach is none.
        let late = (lag_cycles >= REACH).then_some(lag_cycles);
        let step_s = REACH as f64 * dt_s;
        let speed = servo_lag_s / (2.0 * step_s);
        let bend = INERTIA_SHARE * (servo_lag_s / step_s).powi(2);
        let waiting = cycles + late.map_or(0, |late| late + REACH);
        // One place more, so that pushing before popping does not allocate.
        let mut targets = VecDeque::with_capacity(waiting + 1);
        targets.resize(waiting, first);
        Self { targets, cycles, weights: [bend - speed, 1.0 - 2.0 * bend, bend + speed], late }
    }

    /// Takes in the newest target; the oldest goes.
    pub fn push(&mut self, target: f64) {
        self.targets.push_back(target);
        self.targets.pop_front();
    }

    pub fn newest(&self) -> f64 {
        self.targets.back().copied().unwrap_or_default()
    }

    /// What to command after each of the next cycles.
    pub fn commands(&self) -> impl Iterator<Item = f64> + '_ {
        let [before, at, after] = self.weights;
        (0..self.cycles).map(move |cycle| match self.late {
            None => self.targets[cycle],
            Some(_) => {
                let middle = cycle + REACH;
                before * self.targets[middle - REACH]
                    + at * self.targets[middle]
                    + after * self.targets[middle + REACH]
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_lag_targets_are_commands() {
        let mut queue = TargetQueue::new(3, 0.0, 0.01, 0.5);
        queue.push(0.7);
        assert_eq!(queue.commands().collect::<Vec<_>>(), [0.5, 0.5, 0.7]);
        assert_eq!(queue.newest(), 0.7);
    }

    #[test]
    fn steady_motion_is_commanded_as_it_is() {
        // Ahead by the lag and late by the lag.
        let mut queue = TargetQueue::new(4, 0.05, 0.01, 0.0);
        (0..40).for_each(|k| queue.push(0.01 * f64::from(k)));
        let commands: Vec<f64> = queue.commands().collect();
        for (command, wanted) in commands.iter().zip([0.36, 0.37, 0.38, 0.39]) {
            assert!((command - wanted).abs() < 1e-9, "{commands:?}");
        }
    }
}
