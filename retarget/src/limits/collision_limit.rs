//! Last look before the output: arms brake before they meet the body.
//!
//! The solver already asks for a gap, but each joint follows its answer at its
//! own pace, and paths between two good poses can cross the body. So the next
//! positions are changed, as little as possible, until no pair of capsules
//! closes faster than it can brake, after the time that braking takes to build
//! up: `v t + v^2 / 2a = gap`. The limits of every joint hold first; what then
//! still gets too near is counted.

use crate::contact::CapsulePair;
use crate::kinematics::{Jacobian, PosedRobot, RobotModel};
use crate::solver::BoxLeastSquares;
use k::nalgebra::Isometry3;

/// Gap that is kept, metres.
const KEPT_GAP_M: f64 = 0.004;
/// Pairs farther apart than this cannot meet before they are looked at again.
const WATCHED_M: f64 = 0.12;
/// Braking that the tips of arms can do for certain, m/s^2.
const BRAKING_M_S2: f64 = 4.0;
/// Until it is felt, seconds.
const BUILD_UP_S: f64 = 0.06;
/// How much more a gap counts than staying with what was wanted.
const FIRMNESS: f64 = 100.0;

pub(crate) struct CollisionLimit {
    solver: BoxLeastSquares,
    jacobian: Jacobian,
    step: Vec<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
    dt_s: f64,
}

impl CollisionLimit {
    pub fn new(joints: usize, dt_s: f64) -> Self {
        Self {
            solver: BoxLeastSquares::new(joints),
            jacobian: Jacobian::new(joints, joints),
            step: vec![0.0; joints],
            low: vec![0.0; joints],
            high: vec![0.0; joints],
            dt_s,
        }
    }

    /// Where to go from `now` (links at `poses`), if `wanted` is wanted and
    /// `allowed` allowed; changes `wanted`. Says whether it changed anything.
    pub fn apply(
        &mut self,
        model: &RobotModel,
        poses: &[Isometry3<f64>],
        pairs: &[CapsulePair],
        now: &[f64],
        allowed: &[(f64, f64)],
        wanted: &mut [f64],
    ) -> bool {
        let robot = PosedRobot::new(model, poses);
        for (joint, step) in self.step.iter_mut().enumerate() {
            *step = wanted[joint] - now[joint];
        }
        self.solver.clear();
        let mut closing_fast = false;
        for pair in pairs {
            closing_fast |= self.add_pair(&robot, pair);
        }
        if !closing_fast {
            return false;
        }
        for joint in 0..now.len() {
            self.solver.add_scalar(1.0, -self.step[joint], joint);
            self.low[joint] = allowed[joint].0 - now[joint];
            self.high[joint] = allowed[joint].1 - now[joint];
        }
        let steps = self.solver.solve(&self.low, &self.high);
        for (joint, step) in steps.iter().enumerate() {
            wanted[joint] = now[joint] + step;
        }
        true
    }

    /// The step of a joint that was wanted in the last cycle.
    pub fn asked_step(&self, joint: usize) -> f64 {
        self.step[joint]
    }

    pub fn work(&self) -> u64 {
        self.solver.work
    }

    /// Adds a row if the pair closes faster than it can brake.
    fn add_pair(&mut self, robot: &PosedRobot, pair: &CapsulePair) -> bool {
        let gap = pair.gap(robot.poses);
        if gap.distance_m > WATCHED_M {
            return false;
        }
        let left = gap.distance_m - KEPT_GAP_M;
        let speed = match left > 0.0 {
            true => {
                let lost = BRAKING_M_S2 * BUILD_UP_S;
                lost - (lost * lost + 2.0 * BRAKING_M_S2 * left).sqrt()
            }
            // Too near already: apart again, gently.
            false => (-left * 5.0).min(0.3),
        };
        let [one, other] = gap.links;
        self.jacobian.clear();
        self.jacobian.add_point(robot, one, &gap.points[0], 1.0);
        self.jacobian.add_point(robot, other, &gap.points[1], -1.0);
        let closing: f64 = self
            .jacobian
            .columns()
            .iter()
            .map(|(joint, column)| gap.normal.dot(column) * self.step[*joint])
            .sum();
        let least = speed * self.dt_s;
        if closing >= least {
            return false;
        }
        self.jacobian.map(|column| gap.normal * gap.normal.dot(column));
        self.solver.add(FIRMNESS, &(gap.normal * -least), self.jacobian.columns());
        true
    }
}
