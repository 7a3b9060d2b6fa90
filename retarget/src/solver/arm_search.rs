//! Ways out of local minima: at the rate of the dancer's frames each arm is
//! also tried from afar.
//!
//! The body solver descends from its last answer. An arm of few joints can get
//! stuck there: where the axis of its first joint lies along the upper arm,
//! turning that joint does nothing, and an arm that came up the wrong way stays
//! at its stop. So each arm is solved by itself, for directions alone, from a
//! few fixed starts. The way to a better answer may take longer than the dancer
//! stays, and shows the wrong thing meanwhile: the solver moves there only when
//! being stuck has by then cost as much as the way costs, and only when clear of
//! the body. What follows the solver keeps the limits, as ever. One search is
//! spread evenly over the cycles of a frame, so that none takes much longer.
//! Radians, seconds. Nothing allocates after building.

use crate::config::{Limb, TaskWeights};
use crate::dancer::PoseTarget;
use crate::kinematics::{BodyMap, Jacobian, RobotModel};
use crate::solver::searched_arm::{ArmProblem, SearchedArm, TrialPose};
use crate::solver::{BodySolver, LimbTask};
use k::nalgebra::Isometry3;
use servodance_types::{FRAME_RATE_HZ, JointLimits};

pub(crate) struct ArmSearch {
    arms: Vec<SearchedArm>,
    weights: TaskWeights,
    /// Cycles that a search takes, and how many it has had.
    every: usize,
    cycle: usize,
    /// What is searched for: the dancer and the body as the search began.
    aim: PoseTarget,
    trial: TrialPose,
}

impl ArmSearch {
    pub fn new(
        model: &RobotModel,
        map: &BodyMap,
        weights: TaskWeights,
        limits: &[JointLimits],
        dt_s: f64,
    ) -> Self {
        let positions: Vec<f64> = limits.iter().map(|limit| limit.clamp_rad(0.0)).collect();
        let mut poses = vec![Isometry3::identity(); model.links.len()];
        model.place(&Isometry3::identity(), &positions, &mut poses);
        let limbs = map.limbs(model);
        let arms = [Limb::LeftArm, Limb::RightArm]
            .into_iter()
            .enumerate()
            .filter_map(|(side, limb)| {
                let arm = map.arms[side];
                let end = arm.hand.or(arm.elbow)?;
                let joints = (0..limits.len()).filter(|&joint| limbs[joint] == limb);
                let links = (0..model.links.len()).filter(|&link| {
                    model.is_below(link, map.chest)
                        && link != map.chest
                        && (model.is_below(end, link) || model.is_below(link, end))
                });
                let segments = LimbTask::new([arm.shoulder, arm.elbow, arm.hand], &poses);
                SearchedArm::new(side, segments, links.collect(), joints.collect(), limits)
            })
            .collect();
        let every = (1.0 / FRAME_RATE_HZ / dt_s).round().max(1.0) as usize;
        Self {
            arms,
            weights,
            every,
            cycle: 0,
            aim: PoseTarget::standing(),
            trial: TrialPose {
                jacobian: Jacobian::new(limits.len(), limits.len()),
                positions,
                poses,
            },
        }
    }

    /// Call once a cycle, after the solver: moves its arms to better answers
    /// that are worth the way.
    pub fn step(
        &mut self,
        model: &RobotModel,
        body: &mut BodySolver,
        aim: &PoseTarget,
        rest: &[f64],
    ) {
        if self.cycle == 0 {
            self.aim = *aim;
            self.trial.restart_from(model, body);
        }
        self.cycle += 1;
        let last = self.cycle == self.every;
        if last {
            self.cycle = 0;
        }
        let problem = ArmProblem { model, aim: &self.aim, weights: &self.weights, rest };
        for arm in &mut self.arms {
            let share = |cycle: usize| cycle * arm.parts() / self.every;
            let end = if last { self.every } else { self.cycle };
            for part in share(end - 1)..share(end) {
                arm.search(&problem, part, &body.positions, &mut self.trial);
            }
        }
        if last {
            self.trial.restart_from(model, body);
            for arm in &mut self.arms {
                arm.adopt(&problem, body, &mut self.trial);
            }
        }
    }

    pub fn work(&self) -> u64 {
        self.arms.iter().map(SearchedArm::work).sum()
    }
}
