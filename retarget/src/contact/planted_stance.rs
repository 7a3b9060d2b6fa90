//! What only a robot on its feet has: where they are, and what the rest of it
//! has to do with that.

use crate::balance::ZmpGovernor;
use crate::contact::{FootStepper, PelvisTrajectory, SupportPolygon};
use crate::kinematics::BodyMap;
use crate::solver::{BodySolver, Feet};
use k::nalgebra::{Isometry3, Translation3};

/// Time constant with which a planted foot comes back to its place, seconds.
const FOOT_RETURN_S: f64 = 0.03;
/// A planted foot farther away has moved, metres.
const FOOT_MOVED_M: f64 = 0.002;

pub(crate) struct PlantedStance {
    pub feet: Feet,
    /// Where the feet are at rest.
    pub home: Feet,
    /// `None`: the feet stay.
    pub stepper: Option<FootStepper>,
    pub pelvis: PelvisTrajectory,
    pub legs: BodySolver,
    pub governor: ZmpGovernor,
    /// What the governor keeps the plan inside of: the soles, or one sole below the middle
    /// for a robot that is to stand on one.
    pub governed: SupportPolygon,
}

impl PlantedStance {
    /// Where the feet are asked to be next. One that is off its place comes
    /// back in time: to ask for all of it in one cycle takes more jerk than the
    /// legs have at high control rates, and each correction overshoots.
    pub fn feet_to_ask(&self, map: &BodyMap, poses: &[Isometry3<f64>], dt_s: f64) -> Feet {
        let mut feet = self.feet;
        if self.stepper.is_some() {
            return feet;
        }
        let left = 1.0 - (dt_s / FOOT_RETURN_S).min(1.0);
        for (leg, foot) in map.legs.iter().zip(&mut feet) {
            if let Some(sole) = leg.sole {
                let away = poses[sole].translation.vector - foot.translation.vector;
                foot.translation.vector += away * left;
                foot.rotation = foot.rotation.nlerp(&poses[sole].rotation, left);
            }
        }
        feet
    }

    pub fn down(&self) -> [bool; 2] {
        self.stepper.as_ref().map_or([true; 2], FootStepper::down)
    }

    /// Everything stands still again, the root link at `root`.
    pub fn restart(&mut self, root: Isometry3<f64>) {
        self.legs.base = root;
        self.pelvis.restart();
        self.governor.restart();
        if let Some(stepper) = &mut self.stepper {
            stepper.restart(&mut self.feet);
        }
    }

    /// Whether a foot that stands is off its place; `poses` are
    /// those of all links.
    pub fn has_moved_feet(&self, map: &BodyMap, poses: &[Isometry3<f64>]) -> bool {
        let down = self.down();
        (0..2).filter(|&side| down[side]).any(|side| {
            let Some(sole) = map.legs[side].sole else {
                return false;
            };
            let place = poses[sole].translation.vector;
            (place - self.feet[side].translation.vector).norm() > FOOT_MOVED_M
        })
    }

    /// Where the root link is with the feet in their places; `root_from_link`
    /// is where a link is seen from there.
    pub fn world_from_root(
        &self,
        map: &BodyMap,
        root_from_link: impl Fn(usize) -> Isometry3<f64>,
    ) -> Isometry3<f64> {
        let [left, right] = [0, 1].map(|side| {
            // A robot that stands has both soles.
            let sole = map.legs[side].sole.unwrap_or(0);
            self.feet[side] * root_from_link(sole).inverse()
        });
        match self.down() {
            [true, false] => left,
            [false, true] => right,
            _ => Isometry3::from_parts(
                Translation3::from((left.translation.vector + right.translation.vector) * 0.5),
                left.rotation.nlerp(&right.rotation, 0.5),
            ),
        }
    }
}
