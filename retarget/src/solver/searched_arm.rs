//! One arm by itself: descents from fixed starts, and whether the best answer
//! is worth the way. Radians, seconds; nothing allocates after building.

use crate::config::TaskWeights;
use crate::dancer::PoseTarget;
use crate::kinematics::{Jacobian, PosedRobot, RobotModel};
use crate::solver::{BodySolver, BoxLeastSquares, JacobianColumn, LimbTask};
use k::nalgebra::Isometry3;
use servodance_types::{FRAME_RATE_HZ, JointLimits};

/// Gauss-Newton steps from each start, and their damping, 1/rad.
const STEPS: usize = 5;
const DAMPING: f64 = 0.15;
/// Steps from where the solver is, damped as its own, to see where it goes.
const OWN_STEPS: usize = 12;
/// Longest of all steps, radians.
const LONGEST_STEP: f64 = 0.6;
/// Joints, the first of an arm, whose quarters of the range are combined.
const COMBINED: usize = 3;
/// A better answer costs at most this share of the old, and so much less:
/// 0.1 is what a forearm wrong by 36 degrees costs.
const CLEARLY: f64 = 0.7;
const AT_LEAST: f64 = 0.1;
/// What a radian from rest costs beside that: of poses that show the dancer alike the one
/// nearer to rest is taken, however the arm came to where it is.
const AWAY_FROM_REST: f64 = 0.2;
const POSE_WORK: u64 = 60;
/// Searches in a row that must find one.
const IN_A_ROW: usize = 3;
const ON_THE_WAY: usize = 3;
/// What a second on the way costs at least.
const MOVING: f64 = 0.3;
/// Share of what being stuck has cost that still counts after a search without a better answer.
const FADES: f64 = 0.9;

pub(super) struct SearchedArm {
    side: usize,
    segments: LimbTask,
    links: Vec<usize>,
    joints: Vec<usize>,
    bounds: Vec<(f64, f64)>,
    starts: Vec<f64>,
    speeds: Vec<f64>,
    /// What the solver's own way comes to, and the least that was
    /// found in this search.
    own: f64,
    least: f64,
    /// The best answer of the last search, how often in a row one was
    /// clearly better than the solver's, and what it would have
    /// spared: cost times seconds.
    rival: Vec<f64>,
    better: usize,
    missed_s: f64,
    /// The best pose of one descent, and where that is.
    answer: Vec<f64>,
    at: Vec<f64>,
    solver: BoxLeastSquares,
    columns: Vec<JacobianColumn>,
    low: Vec<f64>,
    high: Vec<f64>,
}

pub(super) struct ArmProblem<'a> {
    pub model: &'a RobotModel,
    pub aim: &'a PoseTarget,
    pub weights: &'a TaskWeights,
    pub rest: &'a [f64],
}

/// One pose of the whole robot, to try arms in.
pub(super) struct TrialPose {
    pub positions: Vec<f64>,
    pub poses: Vec<Isometry3<f64>>,
    pub jacobian: Jacobian,
}

impl TrialPose {
    pub fn restart_from(&mut self, model: &RobotModel, body: &mut BodySolver) {
        self.poses.copy_from_slice(body.poses(model));
        self.positions.copy_from_slice(&body.positions);
    }

    fn set(&mut self, joints: &[usize], positions: &[f64]) {
        for (&joint, &position) in joints.iter().zip(positions) {
            self.positions[joint] = position;
        }
    }
}

impl SearchedArm {
    /// `None` without joints to turn.
    pub fn new(
        side: usize,
        segments: LimbTask,
        links: Vec<usize>,
        joints: Vec<usize>,
        limits: &[JointLimits],
    ) -> Option<Self> {
        let size = joints.len();
        if size == 0 {
            return None;
        }
        let bounds: Vec<(f64, f64)> = joints
            .iter()
            .map(|&joint| (limits[joint].lower_rad, limits[joint].upper_rad))
            .collect();
        let speeds = joints.iter().map(|&joint| limits[joint].velocity_rad_s);
        let speeds = speeds.collect();
        let combinations = 1 << size.min(COMBINED);
        let mut starts = Vec::with_capacity(combinations * size);
        for combination in 0..combinations {
            for (index, (lower, upper)) in bounds.iter().enumerate() {
                let share = match index {
                    COMBINED.. => 0.5,
                    _ if combination >> index & 1 == 1 => 0.75,
                    _ => 0.25,
                };
                starts.push(lower + share * (upper - lower));
            }
        }
        Some(Self {
            side,
            segments,
            links,
            joints,
            bounds,
            starts,
            speeds,
            own: 0.0,
            least: 0.0,
            rival: vec![0.0; size],
            better: 0,
            missed_s: 0.0,
            answer: vec![0.0; size],
            at: vec![0.0; size],
            solver: BoxLeastSquares::new(size),
            columns: Vec::with_capacity(size),
            low: vec![0.0; size],
            high: vec![0.0; size],
        })
    }

    pub fn work(&self) -> u64 {
        self.solver.work
    }

    /// Moves the body's arm to what the search found, if that is worth the way
    /// and clear of the body; the trial follows the body.
    pub fn adopt(&mut self, problem: &ArmProblem, body: &mut BodySolver, trial: &mut TrialPose) {
        if self.is_worth_it(problem, &body.positions, trial) {
            self.better = 0;
            self.missed_s = 0.0;
            trial.set(&self.joints, &self.rival);
            self.place(problem.model, trial);
            let mut pairs = body.pairs.iter();
            if pairs.all(|pair| pair.gap(&trial.poses).distance_m > 0.0) {
                for (&joint, &position) in self.joints.iter().zip(&self.rival) {
                    body.positions[joint] = position;
                }
            }
        }
        for &joint in &self.joints {
            trial.positions[joint] = body.positions[joint];
        }
        self.place(problem.model, trial);
    }

    /// Parts of a search: the solver's own way, then each fixed start.
    pub fn parts(&self) -> usize {
        1 + self.starts.len() / self.joints.len()
    }

    pub fn search(
        &mut self,
        problem: &ArmProblem,
        part: usize,
        now: &[f64],
        trial: &mut TrialPose,
    ) {
        let size = self.joints.len();
        if part == 0 {
            for (place, &joint) in self.answer.iter_mut().zip(&self.joints) {
                *place = now[joint];
            }
            let damping = problem.weights.damping.max(DAMPING);
            self.own = self.descend(problem, trial, OWN_STEPS, damping);
            self.least = f64::INFINITY;
            // The best answer of the last search is a start of this one.
            if self.better > 0 {
                self.answer.copy_from_slice(&self.rival);
                self.least = self.descend(problem, trial, STEPS, DAMPING);
                self.rival.copy_from_slice(&self.answer);
            }
            return;
        }
        let start = (part - 1) * size..part * size;
        self.answer.copy_from_slice(&self.starts[start]);
        let cost = self.descend(problem, trial, STEPS, DAMPING);
        if cost < self.least {
            self.least = cost;
            self.rival.copy_from_slice(&self.answer);
        }
    }

    /// Whether what the search found is worth the way from what
    /// the solver has, `now`.
    fn is_worth_it(&mut self, problem: &ArmProblem, now: &[f64], trial: &mut TrialPose) -> bool {
        let (own, least) = (self.own, self.least);
        if least < CLEARLY * own && least < own - AT_LEAST {
            self.better += 1;
            self.missed_s += (own - least) / FRAME_RATE_HZ;
            let way_s = self.way_s(problem, now, own, trial);
            self.better >= IN_A_ROW && self.missed_s > way_s
        } else {
            self.better = 0;
            self.missed_s *= FADES;
            false
        }
    }

    /// What the way from `now` to the rival costs more than staying, times
    /// the seconds it takes.
    fn way_s(&mut self, problem: &ArmProblem, now: &[f64], own: f64, trial: &mut TrialPose) -> f64 {
        let mut cost = 0.0;
        for place in 1..=ON_THE_WAY {
            let share = place as f64 / (ON_THE_WAY + 1) as f64;
            for (index, &joint) in self.joints.iter().enumerate() {
                self.at[index] = now[joint] + share * (self.rival[index] - now[joint]);
            }
            cost += self.linearise(problem, trial, DAMPING) / ON_THE_WAY as f64;
        }
        let seconds = self
            .joints
            .iter()
            .zip(&self.rival)
            .zip(&self.speeds)
            .map(|((&joint, rival), speed)| (rival - now[joint]).abs() / speed)
            .fold(0.0, f64::max);
        seconds * ((cost - own).max(0.0) + MOVING)
    }

    /// Descends from `answer`, leaves the best pose met there, and says its cost.
    fn descend(
        &mut self,
        problem: &ArmProblem,
        trial: &mut TrialPose,
        steps: usize,
        damping: f64,
    ) -> f64 {
        let mut least = f64::INFINITY;
        self.at.copy_from_slice(&self.answer);
        for step in 0..=steps {
            let cost = self.linearise(problem, trial, damping);
            if cost < least {
                least = cost;
                self.answer.copy_from_slice(&self.at);
            }
            if step == steps {
                break;
            }
            for (index, (lower, upper)) in self.bounds.iter().enumerate() {
                let now = self.at[index];
                let reach = |bound: f64| (bound - now).clamp(-LONGEST_STEP, LONGEST_STEP);
                (self.low[index], self.high[index]) = (reach(*lower), reach(*upper));
            }
            let step = self.solver.solve(&self.low, &self.high);
            for (position, step) in self.at.iter_mut().zip(step) {
                *position += step;
            }
        }
        least
    }

    /// Sets up one step from `at`, and says what being there costs.
    fn linearise(&mut self, problem: &ArmProblem, trial: &mut TrialPose, damping: f64) -> f64 {
        trial.set(&self.joints, &self.at);
        self.place(problem.model, trial);
        self.solver.work += POSE_WORK * self.links.len() as u64;
        let robot = PosedRobot::new(problem.model, &trial.poses);
        let aim = problem.aim;
        let wanted = [aim.upper_arm[self.side], aim.forearm[self.side]];
        let (solver, joints, own) = (&mut self.solver, &self.joints, &mut self.columns);
        let mut cost = 0.0;
        solver.clear();
        self.segments.add_rows(&robot, wanted, problem.weights, &mut trial.jacobian, |row| {
            own.clear();
            own.extend(row.columns.iter().filter_map(|(joint, column)| {
                let index = joints.iter().position(|own| own == joint)?;
                Some((index, *column))
            }));
            solver.add(row.weight, &row.residual, own);
            cost += row.weight * row.weight * row.missed.norm_squared();
        });
        for (index, &joint) in joints.iter().enumerate() {
            let away = self.at[index] - problem.rest[joint];
            solver.add_scalar(problem.weights.posture, away, index);
            solver.add_scalar(damping, 0.0, index);
            cost += (AWAY_FROM_REST * away).powi(2);
        }
        cost
    }

    fn place(&self, model: &RobotModel, trial: &mut TrialPose) {
        for &index in &self.links {
            let link = &model.links[index];
            if let Some(parent) = link.parent {
                trial.poses[index] = trial.poses[parent] * link.local(&trial.positions);
            }
        }
    }
}
