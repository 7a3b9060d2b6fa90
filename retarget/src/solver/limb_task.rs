//! How a limb of two segments shows the dancer's: residuals and derivatives.
//!
//! Directions are unit vectors in the world; residuals have no unit.

use crate::config::TaskWeights;
use crate::kinematics::{Jacobian, PosedRobot};
use crate::solver::JacobianColumn;
use k::nalgebra::{Isometry3, Vector3};

/// Directions farther apart than this are approached in parts, radians.
const FAR_RAD: f64 = 1.0;

#[derive(Clone, Copy)]
pub(crate) struct LimbTask {
    pub points: [Option<usize>; 3],
    /// Lengths of the two segments, metres.
    pub lengths: [f64; 2],
}

pub(crate) struct TaskRow<'a> {
    pub weight: f64,
    pub missed: Vector3<f64>,
    /// The part of it to take on in one step.
    pub residual: Vector3<f64>,
    pub columns: &'a [JacobianColumn],
}

impl LimbTask {
    /// The limb through the origins of three links at `poses`.
    pub fn new(points: [Option<usize>; 3], poses: &[Isometry3<f64>]) -> Self {
        let length = |from: Option<usize>, to: Option<usize>| match (from, to) {
            (Some(from), Some(to)) => {
                (poses[to].translation.vector - poses[from].translation.vector).norm()
            }
            _ => 0.0,
        };
        Self { points, lengths: [length(points[0], points[1]), length(points[1], points[2])] }
    }

    /// Asks both segments to point along `wanted` and the end to be where they
    /// would then put it. Parts that the robot lacks ask nothing.
    pub fn add_rows(
        &self,
        robot: &PosedRobot,
        wanted: [Vector3<f64>; 2],
        weights: &TaskWeights,
        jacobian: &mut Jacobian,
        mut put: impl FnMut(TaskRow),
    ) {
        let [Some(top), Some(middle), end] = self.points else {
            return;
        };
        let [upper, lower] = wanted;
        add_segment_row(robot, [top, middle], upper, weights.upper_limb, jacobian, &mut put);
        let Some(end) = end else {
            return;
        };
        add_segment_row(robot, [middle, end], lower, weights.lower_limb, jacobian, &mut put);
        let whole = self.lengths[0] + self.lengths[1];
        if whole > 1e-3 {
            let reach = upper * self.lengths[0] + lower * self.lengths[1];
            let (start, tip_at) = (robot.origin(top), robot.origin(end));
            let missed = (tip_at - start - reach) / whole;
            jacobian.add_point(robot, end, &tip_at, 1.0 / whole);
            jacobian.add_point(robot, top, &start, -1.0 / whole);
            put(TaskRow {
                weight: weights.tip,
                missed,
                residual: capped(&missed),
                columns: jacobian.columns(),
            });
            jacobian.clear();
        }
    }
}

/// Asks that the segment between two links' origins points along `wanted`.
fn add_segment_row(
    robot: &PosedRobot,
    [from, to]: [usize; 2],
    wanted: Vector3<f64>,
    weight: f64,
    jacobian: &mut Jacobian,
    put: &mut impl FnMut(TaskRow),
) {
    let (start, end) = (robot.origin(from), robot.origin(to));
    let length = (end - start).norm();
    if length < 1e-4 {
        return;
    }
    let now = (end - start) / length;
    jacobian.add_point(robot, to, &end, 1.0 / length);
    jacobian.add_point(robot, from, &start, -1.0 / length);
    put(direction_row(now, wanted, weight, jacobian));
    jacobian.clear();
}

/// The aim that `now`, whose derivatives are gathered in
/// `columns`, points along `wanted`.
pub(crate) fn direction_row(
    now: Vector3<f64>,
    wanted: Vector3<f64>,
    weight: f64,
    jacobian: &mut Jacobian,
) -> TaskRow<'_> {
    jacobian.map(|column| column - now * now.dot(column));
    TaskRow {
        weight,
        missed: now - wanted,
        residual: now - intermediate_direction(&now, &wanted),
        columns: jacobian.columns(),
    }
}

pub(crate) fn capped(residual: &Vector3<f64>) -> Vector3<f64> {
    residual.cap_magnitude(0.5)
}

/// `wanted`, or a direction on the way to it: a residual between opposite
/// directions would have no slope.
fn intermediate_direction(now: &Vector3<f64>, wanted: &Vector3<f64>) -> Vector3<f64> {
    let angle = now.dot(wanted).clamp(-1.0, 1.0).acos();
    if angle <= FAR_RAD {
        return *wanted;
    }
    let sideways = wanted - now * now.dot(wanted);
    let other = if now.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let side = sideways.try_normalize(1e-6).unwrap_or_else(|| now.cross(&other).normalize());
    now * FAR_RAD.cos() + side * FAR_RAD.sin()
}
