//! The rest pose, and the stance of a robot on its feet.

use k::nalgebra::{Isometry3, Vector3};
use servodance_types::JointLimits;

use super::joint_setup::by_joint;
use crate::balance::{ArmShare, CarriedAcceleration, GovernorSettings, ZmpGovernor, ZmpWeights};
use crate::config::{BodyKind, RetargetConfig, RetargetError, Stance};
use crate::contact::capsules;
use crate::contact::{FootStepper, FourFeet, PelvisTrajectory, PlantedStance, SupportPolygon};
use crate::dancer::{ArmMount, PoseTarget, antenna_figure, arm_figure};
use crate::description::guess::is_sole_frame;
use crate::kinematics::{BodyMap, PosedRobot, RobotModel, level_rotation};
use crate::solver::{BodySolver, SolverGoal, SolverInput, SolverScope};

const REST_STEPS: usize = 200;
/// How much more slowly the pelvis of a stepping robot speeds up: on one foot
/// there is less room for balance.
const STEPPING_PACE: f64 = 0.5;
/// Least crouch of a stepping robot, leg lengths: a leg that is nearly straight
/// cannot reach for the next place.
const STEPPING_CROUCH: f64 = 0.15;
/// Knees are never straighter: near straight, small steps of the pelvis would
/// need large ones of the knee.
const LEAST_KNEE_RAD: f64 = 0.12;
/// Where the search for the rest pose begins: from straight legs it could not bend them.
const STARTING_KNEE_RAD: f64 = 0.35;
/// A knee that has this much room both ways bends forward.
const KNEE_ROOM_RAD: f64 = 0.4;

/// Places of a knee that are tried for the straightest leg.
const KNEE_PLACES: i32 = 200;

/// What a robot stands on.
pub(super) enum Footing {
    None,
    Two(Box<PlantedStance>),
    Four(Box<FourFeet>),
}

pub(super) struct RestSearch<'a> {
    pub model: &'a RobotModel,
    pub map: BodyMap,
    pub config: &'a RetargetConfig,
    pub upright: Isometry3<f64>,
    pub arm_mount: &'a ArmMount,
    pub dt_s: f64,
    pub limits: &'a mut [JointLimits],
    pub solver: &'a mut BodySolver,
}

impl RestSearch<'_> {
    /// Moves the solver to the rest pose: its answer to an upright dancer, arms
    /// down, with the configured joints put where the configuration says. Gives
    /// the stance of a robot on its feet.
    pub fn run(&mut self) -> Result<Footing, RetargetError> {
        let fixed = self.fixed_joints()?;
        let limits = self.limits.iter();
        let far: Vec<(f64, f64)> = limits.map(|l| (l.lower_rad, l.upper_rad)).collect();
        let zero: Vec<f64> = self.solver.positions.clone();
        if self.config.kind == BodyKind::Quadruped {
            let feet = self.stand_on_four()?;
            self.take_up(&fixed);
            return Ok(Footing::Four(Box::new(feet)));
        }
        let standing = PoseTarget::standing();
        let standing = match self.config.kind {
            BodyKind::Arm => arm_figure(&standing, self.arm_mount),
            BodyKind::Head => antenna_figure(&standing),
            _ => standing,
        };
        self.solver.solve(
            self.model,
            &SolverInput {
                goal: SolverGoal::Dance(&standing),
                rest: &zero,
                steps: REST_STEPS,
                bounds: &far,
            },
        );
        self.keep_knees_bent(&zero, &far);
        let limits = self.limits.iter();
        let far: Vec<(f64, f64)> = limits.map(|l| (l.lower_rad, l.upper_rad)).collect();
        let stance = match self.config.stance.stands() {
            true => Footing::Two(Box::new(self.stand(self.checked_leg_length()?, &zero, &far))),
            false => Footing::None,
        };
        self.take_up(&fixed);
        Ok(stance)
    }

    /// The configured joints where the configuration says, all inside their limits.
    fn take_up(&mut self, fixed: &[(usize, f64)]) {
        for &(joint, position) in fixed {
            self.solver.positions[joint] = position;
        }
        for (joint, limits) in self.limits.iter().enumerate() {
            let position = &mut self.solver.positions[joint];
            *position = limits.clamp_rad(*position);
        }
        let poses = self.solver.poses(self.model).to_vec();
        self.solver.pairs = capsules::pairs(self.model, &self.map, &poses);
    }

    /// Joint indices and positions of `[retarget.rest_deg]`, inside the limits.
    fn fixed_joints(&self) -> Result<Vec<(usize, f64)>, RetargetError> {
        let given = by_joint(self.model, &self.config.rest_deg)?.into_iter();
        let inside = |(joint, degrees): (usize, f64)| {
            let position = self.limits[joint].clamp_rad(degrees.to_radians());
            (joint, position)
        };
        Ok(given.map(inside).collect())
    }

    fn checked_leg_length(&self) -> Result<f64, RetargetError> {
        let length = self.solver.leg_length();
        if self.map.legs.iter().all(|leg| leg.sole.is_some()) && length >= 1e-3 {
            return Ok(length);
        }
        let value = match self.config.stance {
            Stance::Planted => "planted",
            Stance::Stepping => "stepping",
            Stance::Hung => "hung",
        };
        Err(RetargetError::Config {
            key: "stance".into(),
            value: value.into(),
            expected: format!(
                "a robot on its feet needs hip, knee, ankle and sole of both legs in \
                 [retarget.body]; found left {:?}, right {:?}; or use stance = \"hung\"",
                self.leg_names(0),
                self.leg_names(1)
            ),
        })
    }

    fn leg_names(&self, side: usize) -> Vec<&str> {
        let leg = self.map.legs[side];
        let links = [leg.hip, leg.knee, leg.ankle, leg.sole].into_iter();
        let names = links.flatten().map(|link| &self.model.link_names()[link]);
        names.map(String::as_str).collect()
    }

    /// Knees bend one way: forward, so that the foot goes back under the body, where
    /// their range allows it; else to the side that most of their range is on.
    fn keep_knees_bent(&mut self, zero: &[f64], far: &[(f64, f64)]) {
        for leg in self.map.legs {
            let (Some(hip), Some(knee), Some(ankle)) = (leg.hip, leg.knee, leg.ankle) else {
                continue;
            };
            let Some(ancestor) = self.model.driven_ancestors[knee].last() else {
                continue;
            };
            let joint = ancestor.joint;
            let (lower, upper) = far[joint];
            let mut positions = zero.to_vec();
            let mut length_at = |position: f64| {
                positions[joint] = position;
                let hip = self.model.link_pose(hip, &positions);
                let ankle = self.model.link_pose(ankle, &positions);
                (hip.translation.vector - ankle.translation.vector).norm()
            };
            let place = |k: i32| lower + (upper - lower) * f64::from(k) / f64::from(KNEE_PLACES);
            let straight = (0..=KNEE_PLACES)
                .map(place)
                .max_by(|a, b| length_at(*a).total_cmp(&length_at(*b)))
                .unwrap_or(lower);
            let rooms = [straight - lower, upper - straight];
            let up = match rooms.map(|room| room >= KNEE_ROOM_RAD) {
                [true, true] => {
                    let mut forward_m = |position: f64| {
                        positions[joint] = position;
                        (self.upright * self.model.link_pose(ankle, &positions)).translation.x
                    };
                    forward_m(straight + KNEE_ROOM_RAD) < forward_m(straight)
                }
                _ => rooms[1] > rooms[0],
            };
            let limits = &mut self.limits[joint];
            let start = if up {
                limits.lower_rad = (straight + LEAST_KNEE_RAD).clamp(lower, upper - 1e-3);
                straight + STARTING_KNEE_RAD
            } else {
                limits.upper_rad = (straight - LEAST_KNEE_RAD).clamp(lower + 1e-3, upper);
                straight - STARTING_KNEE_RAD
            };
            let here = self.solver.positions[joint];
            let start = if self.config.stance.stands() { start } else { here };
            self.solver.positions[joint] = limits.clamp_rad(start);
        }
    }

    /// Which links belong to the legs.
    fn standing_links(&self) -> Vec<bool> {
        let hips = self.map.legs.map(|leg| leg.hip.unwrap_or(0));
        let below = |link: usize| {
            hips.iter()
                .any(|&hip| hip != 0 && self.model.is_below(link, self.model.last_driven(hip)))
        };
        (0..self.model.links.len()).map(below).collect()
    }

    /// Whether a sole was described with the robot, not added by its robot file.
    fn is_described(&self, sole: usize) -> bool {
        let name = &self.model.link_names()[sole];
        let is_tip = self.config.tip.iter().any(|tip| tip.name == *name);
        !is_tip && is_sole_frame(self.model, sole)
    }

    /// Puts the robot on its feet, sunk a little, its weight between them.
    fn stand(&mut self, leg_m: f64, zero: &[f64], far: &[(f64, f64)]) -> PlantedStance {
        let mut legs = BodySolver::new(
            self.model,
            self.map,
            self.config.weights,
            self.limits,
            self.upright.rotation,
            SolverScope::Stance,
        );
        let steps = self.config.stance == Stance::Stepping;
        let (crouch, pace) = match steps {
            true => (self.config.crouch.max(STEPPING_CROUCH), STEPPING_PACE),
            false => (self.config.crouch, 1.0),
        };
        legs.base = self.upright;
        let (feet, legs_m) = self.flat_feet(&mut legs, zero);
        self.balance(&mut legs, &feet, legs_m + crouch * leg_m, far);
        self.solver.positions.clone_from(&legs.positions);
        self.solver.base = legs.base;
        let (sole_m, dt_s, preview_s) = (self.config.sole_m, self.dt_s, self.config.preview_s);
        let support = SupportPolygon::new(&feet, sole_m);
        let governed = match steps {
            false => support.clone(),
            true => {
                let mut middle = feet[0];
                middle.translation.vector += feet[1].translation.vector;
                middle.translation.vector *= 0.5;
                SupportPolygon::new(&[middle; 2], sole_m)
            }
        };
        // What was reached, not what was asked: rest is then an equilibrium.
        let mut pelvis = PelvisTrajectory::new(legs.base, leg_m, dt_s, preview_s, pace);
        let is_leg = self.standing_links();
        if !steps {
            let carried = CarriedAcceleration {
                robot: PosedRobot::new(self.model, legs.poses(self.model)),
                support: &support,
                is_leg: &is_leg,
            };
            pelvis.carry(carried.pelvis());
            for (limits, carried) in self.limits.iter_mut().zip(carried.joints()) {
                limits.acceleration_rad_s2 = limits.acceleration_rad_s2.min(carried);
            }
        }
        let (settings, arms) = match steps {
            true => (GovernorSettings::STEPPING, None),
            false => {
                let arms = self.arm_share(&mut legs, &feet, &is_leg, &support);
                (GovernorSettings::PLANTED, Some(arms))
            }
        };
        legs.support = Some(support);
        let cycles = (preview_s / dt_s).round() as usize;
        PlantedStance {
            pelvis,
            governor: ZmpGovernor::new(is_leg, settings, arms, dt_s),
            governed,
            feet,
            home: feet,
            stepper: steps.then(|| FootStepper::new(feet, leg_m, sole_m, dt_s, cycles)),
            legs,
        }
    }

    /// The soles on the floor as they are with the joints at `zero`, where legs are straight (or
    /// bent, as they may be) and feet flat; and how far below the root the lower one is, metres.
    fn flat_feet(&self, legs: &mut BodySolver, zero: &[f64]) -> ([Isometry3<f64>; 2], f64) {
        let soles = self.map.legs.map(|leg| leg.sole.unwrap_or(0));
        legs.positions.copy_from_slice(zero);
        let poses = legs.poses(self.model).to_vec();
        let heights = soles.map(|sole| poses[sole].translation.z);
        let mut feet = soles.map(|sole| poses[sole]);
        for (foot, sole) in feet.iter_mut().zip(soles) {
            foot.translation.z = 0.0;
            if self.is_described(sole) {
                foot.rotation = level_rotation(&foot.rotation, &Vector3::z_axis()) * foot.rotation;
            }
        }
        (feet, heights[0].min(heights[1]))
    }

    /// Moves the legs until the root is lower by so much and the weight between the feet.
    fn balance(
        &self,
        legs: &mut BodySolver,
        feet: &[Isometry3<f64>; 2],
        lower_m: f64,
        far: &[(f64, f64)],
    ) {
        let start = &self.solver.positions;
        legs.positions.clone_from(start);
        let middle = (feet[0].translation.vector + feet[1].translation.vector) * 0.5;
        let mut root = self.upright;
        root.translation.z -= lower_m;
        for _ in 0..20 {
            legs.solve(
                self.model,
                &SolverInput {
                    goal: SolverGoal::Stand { root: &root, feet, firmness: [1.0; 2] },
                    rest: start,
                    steps: REST_STEPS / 10,
                    bounds: far,
                },
            );
            let com = self.model.centre_of_mass(legs.poses(self.model));
            root.translation.x -= 0.7 * (com.x - middle.x);
            root.translation.y -= 0.7 * (com.y - middle.y);
        }
    }

    /// How much of the balance arms and head may take.
    fn arm_share(
        &self,
        legs: &mut BodySolver,
        feet: &[Isometry3<f64>; 2],
        is_leg: &[bool],
        support: &SupportPolygon,
    ) -> ArmShare {
        let height_m = self.model.centre_of_mass(legs.poses(self.model)).z - feet[0].translation.z;
        let limbs = self.map.limbs(self.model);
        let is_arm_or_head: Vec<bool> = limbs.iter().map(|limb| limb.is_arm_or_head()).collect();
        let weights = ZmpWeights {
            model: self.model,
            root: legs.base,
            rest: &legs.positions,
            limits: self.limits,
            is_arm_or_head: &is_arm_or_head,
            is_leg,
            support,
        };
        ArmShare::new(height_m, self.config.arm_zmp_limit, weights.by_joint(), self.dt_s)
    }
}
