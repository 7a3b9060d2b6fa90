//! The whole-body problem: all limbs at once, or legs and base at once.
//!
//! Unknowns are the joint positions and, for legs that stand, six of the root
//! link (shift and turn in the world). A robot on its feet is solved in two
//! halves: arms and head for the moment that the preview reaches, legs and root
//! for now, boxed by what the output can follow, so that the feet stay. The
//! halves touch only through the root's pose: an arm shall not pull the body out
//! of its place. Each does a few damped Gauss-Newton steps from its last
//! solution. Nothing allocates after building.

use crate::config::TaskWeights;
use crate::contact::{CapsulePair, SupportPolygon};
use crate::dancer::{PoseTarget, base_figure, plate_figure};
use crate::kinematics::{BodyMap, Jacobian, Platform, PosedRobot, RobotModel, TurningBase};
use crate::solver::{BoxLeastSquares, LimbTask, capped, direction_row};
use k::nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use servodance_types::JointLimits;

/// Weight of foot places (1/m) and foot orientations (1/rad): a millimetre
/// weighs as much as turning all limbs the wrong way.
const FOOT_PLACE: f64 = 2000.0;
const FOOT_TURN: f64 = 200.0;
/// Weight of the pelvis place, 1/m, and of its orientation, 1/rad: what the
/// legs cannot reach is shared between the two.
const PELVIS_PLACE: f64 = 50.0;
const ROOT_TURN: f64 = 5.0;
const STANCE_DAMPING: f64 = 0.02;
/// Capsules nearer than this push each other apart, with this weight, 1/m.
const SAFE_GAP_M: f64 = 0.012;
const GAP: f64 = 100.0;
/// The centre of mass keeps this far inside the support polygon; 1/m.
const SAFE_EDGE_M: f64 = 0.012;
const BALANCE: f64 = 200.0;
/// Longest Gauss-Newton step, radians (metres for the base).
const LONGEST_STEP: f64 = 0.25;

/// Where the feet are to stay, in the world; `[left, right]`.
pub(crate) type Feet = [Isometry3<f64>; 2];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SolverScope {
    Hung,
    /// What a robot on its feet has above the legs.
    Upper,
    Stance,
}

#[derive(Clone, Copy)]
pub(crate) enum SolverGoal<'a> {
    /// Show the dancer's limbs, head and chest; the root link stays at `base`.
    Dance(&'a PoseTarget),
    /// Bring the root link to `root` while the feet stay; the others stay, too.
    Stand {
        root: &'a Isometry3<f64>,
        feet: &'a Feet,
        /// How firmly each foot is held: 1 where it carries.
        firmness: [f64; 2],
    },
    /// Bring the feet of a body on four legs to their places; the root link stays.
    FourFeet { links: &'a [usize; 4], places: &'a [Point3<f64>; 4] },
}

pub(crate) struct SolverInput<'a> {
    pub goal: SolverGoal<'a>,
    pub rest: &'a [f64],
    pub steps: usize,
    /// Lowest and highest position of each joint in this solve.
    pub bounds: &'a [(f64, f64)],
}

#[derive(Clone, Copy)]
struct SolvedLimb {
    segments: LimbTask,
    is_leg: bool,
    side: usize,
}

pub(crate) struct BodySolver {
    map: BodyMap,
    limbs: [SolvedLimb; 4],
    weights: TaskWeights,
    floating: bool,
    legs_stand: bool,
    /// Orientation of the chest link when the robot stands upright.
    chest_rest: UnitQuaternion<f64>,
    /// Orientation of the head link when the robot stands upright, and its face in it.
    head_upright: UnitQuaternion<f64>,
    face_in_head: Vector3<f64>,
    pub positions: Vec<f64>,
    pub base: Isometry3<f64>,
    /// What must not meet, and where the weight must stay; found after rest.
    pub pairs: Vec<CapsulePair>,
    pub support: Option<SupportPolygon>,
    /// The base on wheels, which turns on the spot.
    pub turning_base: Option<TurningBase>,
    poses: Vec<Isometry3<f64>>,
    solver: BoxLeastSquares,
    jacobian: Jacobian,
    low: Vec<f64>,
    high: Vec<f64>,
}

impl BodySolver {
    pub fn new(
        model: &RobotModel,
        map: BodyMap,
        weights: TaskWeights,
        limits: &[JointLimits],
        upright: UnitQuaternion<f64>,
        role: SolverScope,
    ) -> Self {
        let floating = role == SolverScope::Stance;
        let joints = limits.len();
        let unknowns = if floating { joints + 6 } else { joints };
        let positions: Vec<f64> = limits.iter().map(|limit| limit.clamp_rad(0.0)).collect();
        let mut poses = vec![Isometry3::identity(); model.links.len()];
        model.place(&Isometry3::identity(), &positions, &mut poses);
        let limb = |points, is_leg, side| SolvedLimb {
            segments: LimbTask::new(points, &poses),
            is_leg,
            side,
        };
        let [left, right] = map.arms;
        let [left_leg, right_leg] = map.legs;
        let limbs = [
            limb([left.shoulder, left.elbow, left.hand], false, 0),
            limb([right.shoulder, right.elbow, right.hand], false, 1),
            limb([left_leg.hip, left_leg.knee, left_leg.ankle], true, 0),
            limb([right_leg.hip, right_leg.knee, right_leg.ankle], true, 1),
        ];
        let in_root = |link: usize| poses[link].rotation;
        let head_upright =
            map.head.map_or_else(UnitQuaternion::identity, |head| upright * in_root(head));
        Self {
            limbs,
            weights,
            floating,
            legs_stand: role != SolverScope::Hung,
            chest_rest: upright * in_root(map.chest),
            head_upright,
            face_in_head: head_upright.inverse() * Vector3::x(),
            base: Isometry3::from_parts(Translation3::identity(), upright),
            map,
            positions,
            pairs: Vec::new(),
            support: None,
            turning_base: None,
            solver: BoxLeastSquares::new(unknowns),
            jacobian: Jacobian::new(joints, unknowns),
            low: vec![0.0; unknowns],
            high: vec![0.0; unknowns],
            poses,
        }
    }

    /// Length of the legs, hip to ankle, metres; 0 without legs.
    pub fn leg_length(&self) -> f64 {
        let [_, _, left, right] = &self.limbs;
        let length = |leg: &SolvedLimb| leg.segments.lengths.iter().sum();
        f64::midpoint(length(left), length(right))
    }

    pub fn poses(&mut self, model: &RobotModel) -> &[Isometry3<f64>] {
        model.place(&self.base, &self.positions, &mut self.poses);
        &self.poses
    }

    pub fn work(&self) -> u64 {
        self.solver.work
    }

    pub fn solve(&mut self, model: &RobotModel, input: &SolverInput) {
        if let SolverGoal::Dance(aim) = input.goal {
            self.set_wheels(aim, input);
            self.set_cranks(model, aim, input.bounds);
        }
        for _ in 0..input.steps {
            self.step(model, input);
        }
    }

    /// Turns the base as the dancer's body turns, as far as the wheels may go. The steps
    /// leave the wheels there.
    fn set_wheels(&mut self, aim: &PoseTarget, input: &SolverInput) {
        let Some(base) = &self.turning_base else { return };
        let turn = base.within(base_figure(aim), input.rest, input.bounds);
        for wheel in &base.wheels {
            let (low, high) = input.bounds[wheel.joint];
            let at = input.rest[wheel.joint] + turn * wheel.per_rad;
            self.positions[wheel.joint] = at.max(low).min(high);
        }
        self.base = base.turned(base.turn_rad(&self.positions, input.rest));
    }

    /// The platform that carries the head, and the head's link.
    fn head_on_platform<'a>(&self, model: &'a RobotModel) -> Option<(&'a Platform, usize)> {
        let (platform, head) = model.platform.as_deref().zip(self.map.head)?;
        model.is_below(head, platform.plate).then_some((platform, head))
    }

    /// Where the plate puts the head as the dancer has his, links being at `poses`.
    fn plate_in_world(
        &self,
        platform: &Platform,
        poses: &[Isometry3<f64>],
        head: usize,
        aim: &PoseTarget,
    ) -> Isometry3<f64> {
        let (turn, shift) = plate_figure(aim);
        let head_from_plate = poses[head].rotation.inverse() * poses[platform.plate].rotation;
        let home = poses[platform.carrier] * platform.home;
        let at = home.translation.vector + shift * platform.rods[0].length_m;
        Isometry3::from_parts(at.into(), turn * self.head_upright * head_from_plate)
    }

    /// Turns the cranks to where the plate's pose has them, or as far as they may go. The
    /// steps leave them there.
    fn set_cranks(&mut self, model: &RobotModel, aim: &PoseTarget, bounds: &[(f64, f64)]) {
        let Some((platform, head)) = self.head_on_platform(model) else { return };
        model.place(&self.base, &self.positions, &mut self.poses);
        let wanted = self.plate_in_world(platform, &self.poses, head, aim);
        let in_carrier = self.poses[platform.carrier].inverse() * wanted;
        let Some(cranks) = platform.crank_rad(&in_carrier) else { return };
        for (rod, crank) in platform.rods.iter().zip(cranks) {
            let (joint, (low, high)) = (rod.drive.joint, bounds[rod.drive.joint]);
            let at = (crank - rod.drive.offset) / rod.drive.scale;
            self.positions[joint] = at.max(low).min(high);
        }
    }

    fn step(&mut self, model: &RobotModel, input: &SolverInput) {
        let joints = self.positions.len();
        model.place(&self.base, &self.positions, &mut self.poses);
        self.solver.clear();
        // Taken out for the while, so that the parts can be borrowed apart.
        let poses = std::mem::take(&mut self.poses);
        let robot = PosedRobot::new(model, &poses);
        match input.goal {
            SolverGoal::Dance(aim) => {
                self.add_limb_tasks(&robot, aim);
                self.add_trunk_tasks(&robot, aim);
                self.add_collision_tasks(&robot);
            }
            SolverGoal::Stand { root, feet, firmness } => {
                self.add_stance_tasks(&robot, root, feet, firmness);
                self.add_balance_tasks(&robot);
            }
            SolverGoal::FourFeet { links, places } => {
                for (link, place) in links.iter().zip(places) {
                    let point = robot.origin(*link);
                    self.jacobian.add_point(&robot, *link, &point, 1.0);
                    self.add_gathered(FOOT_PLACE, &capped(&(point - place)));
                }
            }
        }
        self.poses = poses;
        // Legs that stand are tied to root and feet: damping would only make
        // the root late.
        let damping = match input.goal {
            SolverGoal::Dance(_) => self.weights.damping,
            SolverGoal::Stand { .. } | SolverGoal::FourFeet { .. } => {
                self.weights.damping.min(STANCE_DAMPING)
            }
        };
        for column in 0..self.low.len() {
            self.solver.add_scalar(damping, 0.0, column);
        }
        for (column, rest) in input.rest.iter().enumerate() {
            let away = self.positions[column] - rest;
            self.solver.add_scalar(self.weights.posture, away, column);
        }
        self.set_bounds(model, input);
        let step = self.solver.solve(&self.low, &self.high);
        for (column, position) in self.positions.iter_mut().enumerate() {
            *position += step[column];
        }
        if self.floating {
            let shift = Vector3::new(step[joints], step[joints + 1], step[joints + 2]);
            let turn = Vector3::new(step[joints + 3], step[joints + 4], step[joints + 5]);
            self.base.translation.vector += shift;
            self.base.rotation = UnitQuaternion::from_scaled_axis(turn) * self.base.rotation;
            self.base.rotation.renormalize_fast();
        }
    }

    fn set_bounds(&mut self, model: &RobotModel, input: &SolverInput) {
        let joints = self.positions.len();
        for column in 0..joints {
            let now = self.positions[column];
            let (low, high) = input.bounds[column];
            self.low[column] = (low - now).clamp(-LONGEST_STEP, LONGEST_STEP);
            self.high[column] = (high - now).clamp(-LONGEST_STEP, LONGEST_STEP);
        }
        let platform = self.head_on_platform(model);
        for rod in platform.into_iter().flat_map(|(platform, _)| &platform.rods) {
            (self.low[rod.drive.joint], self.high[rod.drive.joint]) = (0.0, 0.0);
        }
        for wheel in self.turning_base.iter().flat_map(|base| &base.wheels) {
            (self.low[wheel.joint], self.high[wheel.joint]) = (0.0, 0.0);
        }
        self.low[joints..].fill(-LONGEST_STEP);
        self.high[joints..].fill(LONGEST_STEP);
    }

    fn add_limb_tasks(&mut self, robot: &PosedRobot, aim: &PoseTarget) {
        for limb in self.limbs {
            // Legs that stand follow from pelvis and feet.
            if limb.is_leg && self.legs_stand {
                continue;
            }
            let wanted = match limb.is_leg {
                false => [aim.upper_arm[limb.side], aim.forearm[limb.side]],
                true => [aim.thigh[limb.side], aim.shank[limb.side]],
            };
            let solver = &mut self.solver;
            limb.segments.add_rows(robot, wanted, &self.weights, &mut self.jacobian, |row| {
                solver.add(row.weight, &row.residual, row.columns);
            });
        }
    }

    /// Puts the gathered columns into the problem, and begins anew.
    fn add_gathered(&mut self, weight: f64, residual: &Vector3<f64>) {
        self.solver.add(weight, residual, self.jacobian.columns());
        self.jacobian.clear();
    }

    fn add_trunk_tasks(&mut self, robot: &PosedRobot, aim: &PoseTarget) {
        let TaskWeights { torso, head, .. } = self.weights;
        // A head on a platform has its pose from its cranks.
        if let (Some(link), None) = (self.map.head, self.head_on_platform(robot.model)) {
            let now = robot.poses[link].rotation * self.face_in_head;
            self.jacobian.add_rotation(robot, link);
            self.jacobian.map(|column| column.cross(&now));
            let row = direction_row(now, aim.face, head, &mut self.jacobian);
            self.solver.add(row.weight, &row.residual, row.columns);
            self.jacobian.clear();
        }
        // A chest that is rigid with the root goes where that goes.
        if !robot.model.driven_ancestors[self.map.chest].is_empty() {
            self.add_orientation_task(robot, self.map.chest, aim.chest * self.chest_rest, torso);
        }
    }

    fn add_stance_tasks(
        &mut self,
        robot: &PosedRobot,
        root: &Isometry3<f64>,
        feet: &Feet,
        firmness: [f64; 2],
    ) {
        self.add_orientation_task(robot, 0, root.rotation, ROOT_TURN);
        self.add_position_task(robot, 0, root.translation.vector, PELVIS_PLACE);
        for ((leg, foot), firmness) in self.map.legs.into_iter().zip(feet).zip(firmness) {
            if let Some(sole) = leg.sole {
                self.add_orientation_task(robot, sole, foot.rotation, FOOT_TURN * firmness);
                self.add_position_task(robot, sole, foot.translation.vector, FOOT_PLACE * firmness);
            }
        }
    }

    fn add_orientation_task(
        &mut self,
        robot: &PosedRobot,
        link: usize,
        wanted: UnitQuaternion<f64>,
        weight: f64,
    ) {
        let away = (robot.poses[link].rotation * wanted.inverse()).scaled_axis();
        self.jacobian.add_rotation(robot, link);
        if self.floating {
            self.jacobian.add_rotation_by_root();
        }
        self.add_gathered(weight, &capped(&away));
    }

    fn add_position_task(
        &mut self,
        robot: &PosedRobot,
        link: usize,
        wanted: Vector3<f64>,
        weight: f64,
    ) {
        let point = robot.origin(link);
        self.jacobian.add_point(robot, link, &point, 1.0);
        self.jacobian.add_point_by_root(robot, &point);
        self.add_gathered(weight, &capped(&(point.coords - wanted)));
    }

    /// Pushes arms away from what they come too near to. The root is left out:
    /// an arm shall not push the body.
    fn add_collision_tasks(&mut self, robot: &PosedRobot) {
        for pair in &self.pairs {
            let gap = pair.gap(robot.poses);
            let short = gap.distance_m - SAFE_GAP_M;
            if short < 0.0 {
                let [one, other] = gap.links;
                self.jacobian.add_point(robot, one, &gap.points[0], 1.0);
                self.jacobian.add_point(robot, other, &gap.points[1], -1.0);
                self.jacobian.map(|column| gap.normal * gap.normal.dot(column));
                let residual = capped(&(gap.normal * short));
                self.solver.add(GAP, &residual, self.jacobian.columns());
                self.jacobian.clear();
            }
        }
    }

    /// Keeps the centre of mass off the edge of the support polygon, by
    /// legs and root alone.
    fn add_balance_tasks(&mut self, robot: &PosedRobot) {
        let Some(support) = &self.support else {
            return;
        };
        let com = robot.model.centre_of_mass(robot.poses);
        for edge in &support.edges {
            let over = edge.outside_m(&com) + SAFE_EDGE_M;
            if over > 0.0 {
                // The body moves over the feet nearly as one.
                self.jacobian.add_point_by_root(robot, &com);
                self.jacobian.map(|column| edge.normal * edge.normal.dot(column));
                self.solver.add(BALANCE, &capped(&(edge.normal * over)), self.jacobian.columns());
                self.jacobian.clear();
            }
        }
    }
}
