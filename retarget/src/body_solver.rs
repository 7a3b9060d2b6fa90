//! The whole-body problem: all limbs, feet and the base at once.
//!
//! Unknowns are the joint positions and, for a planted robot, six of the root
//! link (shift and turn in the world). Every cycle does a few damped
//! Gauss-Newton steps from the last solution; joint positions stay inside
//! their limits and move at most `velocity * dt` a cycle, so that other joints
//! help where one is at its limit. Nothing allocates after building.

use k::nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use servodance_types::JointLimits;

use crate::body::BodyMap;
use crate::config::Weights;
use crate::human::Aim;
use crate::model::{Motion, RobotModel};
use crate::solver::{Column, Solver};

/// Weight of foot places (1/m) and foot orientations (1/rad): a millimetre
/// weighs as much as turning all limbs the wrong way.
const FOOT_PLACE: f64 = 2000.0;
const FOOT_TURN: f64 = 200.0;
/// Weight of the pelvis place, 1/m, and of its orientation, 1/rad: what the
/// legs cannot reach is shared between the two.
const PELVIS_PLACE: f64 = 50.0;
const ROOT_TURN: f64 = 5.0;
/// Longest Gauss-Newton step, radians (metres for the base).
const LONGEST_STEP: f64 = 0.25;
/// Directions farther apart than this are approached in parts, radians.
const FAR_RAD: f64 = 1.0;

/// Where the feet are to stay, in the world; `[left, right]`.
pub(crate) type Feet = [Isometry3<f64>; 2];

/// What one solve is asked.
pub(crate) struct Question<'a> {
    pub aim: &'a Aim,
    /// Place and orientation of the root link; feet that stay. `None`: hung.
    pub standing: Option<(&'a Isometry3<f64>, &'a Feet)>,
    pub rest: &'a [f64],
    pub steps: usize,
    /// Lowest and highest position of each joint in this solve.
    pub bounds: &'a [(f64, f64)],
}

/// A limb of two segments: link indices of its three points.
#[derive(Clone, Copy)]
struct Limb {
    points: [Option<usize>; 3],
    /// Lengths of the two segments, metres.
    lengths: [f64; 2],
    is_leg: bool,
    side: usize,
}

pub(crate) struct BodySolver {
    map: BodyMap,
    limbs: [Limb; 4],
    weights: Weights,
    floating: bool,
    /// Orientation of the chest link when the robot stands upright.
    chest_rest: UnitQuaternion<f64>,
    face_in_head: Vector3<f64>,
    pub positions: Vec<f64>,
    pub base: Isometry3<f64>,
    poses: Vec<Isometry3<f64>>,
    solver: Solver,
    columns: Vec<Column>,
    low: Vec<f64>,
    high: Vec<f64>,
}

impl BodySolver {
    pub fn new(
        model: &RobotModel,
        map: BodyMap,
        weights: Weights,
        limits: &[JointLimits],
        upright: UnitQuaternion<f64>,
        floating: bool,
    ) -> Self {
        let joints = limits.len();
        let unknowns = if floating { joints + 6 } else { joints };
        let positions: Vec<f64> = limits.iter().map(|limit| limit.clamp_rad(0.0)).collect();
        let mut poses = vec![Isometry3::identity(); model.links.len()];
        model.place(&Isometry3::identity(), &positions, &mut poses);
        let limb = |points: [Option<usize>; 3], is_leg, side| Limb {
            points,
            lengths: [
                distance(&poses, points[0], points[1]),
                distance(&poses, points[1], points[2]),
            ],
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
        let head_upright = map
            .head
            .map_or_else(UnitQuaternion::identity, |head| upright * in_root(head));
        Self {
            limbs,
            weights,
            floating,
            chest_rest: upright * in_root(map.chest),
            face_in_head: head_upright.inverse() * Vector3::x(),
            base: Isometry3::from_parts(Translation3::identity(), upright),
            map,
            positions,
            solver: Solver::new(unknowns),
            columns: Vec::with_capacity(unknowns),
            low: vec![0.0; unknowns],
            high: vec![0.0; unknowns],
            poses,
        }
    }

    /// Length of the legs, hip to ankle, metres; 0 without legs.
    pub fn leg_length(&self) -> f64 {
        let [_, _, left, right] = &self.limbs;
        f64::midpoint(left.lengths.iter().sum(), right.lengths.iter().sum())
    }

    /// Poses of the links in the world, at the present solution.
    pub fn poses(&mut self, model: &RobotModel) -> &[Isometry3<f64>] {
        model.place(&self.base, &self.positions, &mut self.poses);
        &self.poses
    }

    /// Moves the solution towards the best answer.
    pub fn solve(&mut self, model: &RobotModel, question: &Question) {
        for _ in 0..question.steps {
            self.step(model, question);
        }
    }

    fn step(&mut self, model: &RobotModel, question: &Question) {
        let joints = self.positions.len();
        model.place(&self.base, &self.positions, &mut self.poses);
        self.solver.clear();
        self.ask_limbs(model, question);
        self.ask_body(model, question);
        for column in 0..self.low.len() {
            self.solver.add_single(self.weights.damping, 0.0, column);
        }
        for (column, rest) in question.rest.iter().enumerate() {
            let away = self.positions[column] - rest;
            self.solver.add_single(self.weights.posture, away, column);
        }
        self.set_box(question);
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

    fn set_box(&mut self, question: &Question) {
        let joints = self.positions.len();
        for column in 0..joints {
            let now = self.positions[column];
            let (low, high) = question.bounds[column];
            self.low[column] = (low - now).clamp(-LONGEST_STEP, LONGEST_STEP);
            self.high[column] = (high - now).clamp(-LONGEST_STEP, LONGEST_STEP);
        }
        self.low[joints..].fill(-LONGEST_STEP);
        self.high[joints..].fill(LONGEST_STEP);
    }

    fn ask_limbs(&mut self, model: &RobotModel, question: &Question) {
        let Weights {
            upper_limb,
            lower_limb,
            tip,
            ..
        } = self.weights;
        let aim = question.aim;
        for limb in self.limbs {
            // The legs of a planted robot follow from pelvis and feet.
            if limb.is_leg && question.standing.is_some() {
                continue;
            }
            let (upper, lower) = match limb.is_leg {
                false => (aim.upper_arm[limb.side], aim.forearm[limb.side]),
                true => (aim.thigh[limb.side], aim.shank[limb.side]),
            };
            let [Some(top), Some(middle), end] = limb.points else {
                continue;
            };
            self.ask_segment(model, [top, middle], upper, upper_limb);
            let Some(end) = end else {
                continue;
            };
            self.ask_segment(model, [middle, end], lower, lower_limb);
            let whole = limb.lengths[0] + limb.lengths[1];
            if whole > 1e-3 {
                let reach = upper * limb.lengths[0] + lower * limb.lengths[1];
                let now = self.origin(end) - self.origin(top);
                let residual = near(&((now - reach) / whole));
                self.gather(model, end, self.origin(end), 1.0 / whole);
                self.gather(model, top, self.origin(top), -1.0 / whole);
                self.solver.add(tip, &residual, &self.columns);
                self.columns.clear();
            }
        }
    }

    /// Asks that the segment between two links' origins points along `wanted`.
    fn ask_segment(
        &mut self,
        model: &RobotModel,
        [from, to]: [usize; 2],
        wanted: Vector3<f64>,
        weight: f64,
    ) {
        let (start, end) = (self.origin(from), self.origin(to));
        let length = (end - start).norm();
        if length < 1e-4 {
            return;
        }
        let now = (end - start) / length;
        self.gather(model, to, end, 1.0 / length);
        self.gather(model, from, start, -1.0 / length);
        self.ask_direction(now, wanted, weight);
    }

    /// Uses up the gathered columns (derivatives of a vector along `now`).
    fn ask_direction(&mut self, now: Vector3<f64>, wanted: Vector3<f64>, weight: f64) {
        for (_, column) in &mut self.columns {
            *column -= now * now.dot(column);
        }
        let residual = now - toward(&now, &wanted);
        self.solver.add(weight, &residual, &self.columns);
        self.columns.clear();
    }

    fn ask_body(&mut self, model: &RobotModel, question: &Question) {
        let Weights { torso, head, .. } = self.weights;
        if let Some(link) = self.map.head {
            let now = self.poses[link].rotation * self.face_in_head;
            self.gather_turning(model, link);
            for (_, column) in &mut self.columns {
                *column = column.cross(&now);
            }
            self.ask_direction(now, question.aim.face, head);
        }
        if let Some((root, feet)) = question.standing {
            let root_turn = root.rotation;
            self.ask_turn(model, 0, root_turn, ROOT_TURN);
            let shift = self.base.translation.vector - root.translation.vector;
            self.gather_base(self.origin(0), 1.0);
            self.solver.add(PELVIS_PLACE, &shift, &self.columns);
            self.columns.clear();
            for (leg, foot) in self.map.legs.into_iter().zip(feet) {
                if let Some(sole) = leg.sole {
                    self.ask_turn(model, sole, foot.rotation, FOOT_TURN);
                    let point = self.origin(sole);
                    let away = point.coords - foot.translation.vector;
                    self.gather(model, sole, point, 1.0);
                    self.gather_base(point, 1.0);
                    self.solver.add(FOOT_PLACE, &near(&away), &self.columns);
                    self.columns.clear();
                }
            }
        }
        // A chest that is rigid with the root has been asked already.
        if !model.levers[self.map.chest].is_empty() {
            let chest = question.aim.chest * self.chest_rest;
            self.ask_turn(model, self.map.chest, chest, torso);
        }
    }

    fn ask_turn(
        &mut self,
        model: &RobotModel,
        link: usize,
        wanted: UnitQuaternion<f64>,
        weight: f64,
    ) {
        let away = (self.poses[link].rotation * wanted.inverse()).scaled_axis();
        self.gather_turning(model, link);
        if self.floating {
            self.gather_base_turning();
        }
        self.solver.add(weight, &near(&away), &self.columns);
        self.columns.clear();
    }

    fn origin(&self, link: usize) -> Point3<f64> {
        Point3::from(self.poses[link].translation.vector)
    }

    /// Adds the derivatives of a point fixed to `link`, times `scale`.
    fn gather(&mut self, model: &RobotModel, link: usize, point: Point3<f64>, scale: f64) {
        for lever in &model.levers[link] {
            let pose = &self.poses[lever.link];
            let column = match model.links[lever.link].motion {
                Motion::Turn(axis) => (pose.rotation * axis.into_inner())
                    .cross(&(point.coords - pose.translation.vector)),
                Motion::Slide(axis) => pose.rotation * axis.into_inner(),
                Motion::Fixed => continue,
            };
            put(
                &mut self.columns,
                lever.joint,
                column * (lever.scale * scale),
            );
        }
    }

    /// Adds the derivatives of a point by the six of the base. Limbs do without:
    /// they shall not pull the body out of its place.
    fn gather_base(&mut self, point: Point3<f64>, scale: f64) {
        let joints = self.positions.len();
        let arm = point.coords - self.base.translation.vector;
        for (axis, unit) in units().into_iter().enumerate() {
            put(&mut self.columns, joints + axis, unit * scale);
            put(
                &mut self.columns,
                joints + 3 + axis,
                unit.cross(&arm) * scale,
            );
        }
    }

    /// Adds the turning rates of `link`.
    fn gather_turning(&mut self, model: &RobotModel, link: usize) {
        for lever in &model.levers[link] {
            if let Motion::Turn(axis) = model.links[lever.link].motion {
                let rate = self.poses[lever.link].rotation * axis.into_inner() * lever.scale;
                put(&mut self.columns, lever.joint, rate);
            }
        }
    }

    fn gather_base_turning(&mut self) {
        let joints = self.positions.len();
        for (axis, unit) in units().into_iter().enumerate() {
            put(&mut self.columns, joints + 3 + axis, unit);
        }
    }
}

/// Adds to the column if it is there, so that each appears once.
fn put(columns: &mut Vec<Column>, index: usize, value: Vector3<f64>) {
    match columns.iter_mut().find(|(other, _)| *other == index) {
        Some((_, sum)) => *sum += value,
        None => columns.push((index, value)),
    }
}

fn units() -> [Vector3<f64>; 3] {
    [Vector3::x(), Vector3::y(), Vector3::z()]
}

fn distance(poses: &[Isometry3<f64>], from: Option<usize>, to: Option<usize>) -> f64 {
    match (from, to) {
        (Some(from), Some(to)) => {
            (poses[to].translation.vector - poses[from].translation.vector).norm()
        }
        _ => 0.0,
    }
}

/// A residual no longer than Gauss-Newton can trust.
fn near(residual: &Vector3<f64>) -> Vector3<f64> {
    residual.cap_magnitude(0.5)
}

/// `wanted`, or a direction on the way to it: a residual between opposite
/// directions would have no slope.
fn toward(now: &Vector3<f64>, wanted: &Vector3<f64>) -> Vector3<f64> {
    let angle = now.dot(wanted).clamp(-1.0, 1.0).acos();
    if angle <= FAR_RAD {
        return *wanted;
    }
    let sideways = wanted - now * now.dot(wanted);
    let other = if now.x.abs() < 0.9 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let side = sideways
        .try_normalize(1e-6)
        .unwrap_or_else(|| now.cross(&other).normalize());
    now * FAR_RAD.cos() + side * FAR_RAD.sin()
}
