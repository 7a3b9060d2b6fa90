//! How a limb of two segments shows the dancer's: residuals and derivatives.
//!
//! Directions are unit vectors in the world; residuals have no unit.

use k::nalgebra::{Isometry3, Vector3};

use crate::columns::{Columns, Posed};
use crate::config::Weights;
use crate::solver::Column;

/// Directions farther apart than this are approached in parts, radians.
const FAR_RAD: f64 = 1.0;

/// A limb: link indices of its three points.
#[derive(Clone, Copy)]
pub(crate) struct TwoSegments {
    pub points: [Option<usize>; 3],
    /// Lengths of the two segments, metres.
    pub lengths: [f64; 2],
}

/// One aim at one pose.
pub(crate) struct Row<'a> {
    pub weight: f64,
    /// How far the aim is missed.
    pub missed: Vector3<f64>,
    /// The part of it to take on in one step.
    pub residual: Vector3<f64>,
    pub columns: &'a [Column],
}

impl TwoSegments {
    /// The limb through the origins of three links at `poses`.
    pub fn new(points: [Option<usize>; 3], poses: &[Isometry3<f64>]) -> Self {
        let length = |from: Option<usize>, to: Option<usize>| match (from, to) {
            (Some(from), Some(to)) => {
                (poses[to].translation.vector - poses[from].translation.vector).norm()
            }
            _ => 0.0,
        };
        Self {
            points,
            lengths: [length(points[0], points[1]), length(points[1], points[2])],
        }
    }

    /// Asks both segments to point along `wanted` and the end to be where they
    /// would then put it. Parts that the robot lacks ask nothing.
    pub fn ask(
        &self,
        robot: &Posed,
        wanted: [Vector3<f64>; 2],
        weights: &Weights,
        columns: &mut Columns,
        mut put: impl FnMut(Row),
    ) {
        let [Some(top), Some(middle), end] = self.points else {
            return;
        };
        let [upper, lower] = wanted;
        ask_segment(
            robot,
            [top, middle],
            upper,
            weights.upper_limb,
            columns,
            &mut put,
        );
        let Some(end) = end else {
            return;
        };
        ask_segment(
            robot,
            [middle, end],
            lower,
            weights.lower_limb,
            columns,
            &mut put,
        );
        let whole = self.lengths[0] + self.lengths[1];
        if whole > 1e-3 {
            let reach = upper * self.lengths[0] + lower * self.lengths[1];
            let (start, tip_at) = (robot.origin(top), robot.origin(end));
            let missed = (tip_at - start - reach) / whole;
            columns.point(robot, end, &tip_at, 1.0 / whole);
            columns.point(robot, top, &start, -1.0 / whole);
            put(Row {
                weight: weights.tip,
                missed,
                residual: near(&missed),
                columns: columns.list(),
            });
            columns.clear();
        }
    }
}

/// Asks that the segment between two links' origins points along `wanted`.
fn ask_segment(
    robot: &Posed,
    [from, to]: [usize; 2],
    wanted: Vector3<f64>,
    weight: f64,
    columns: &mut Columns,
    put: &mut impl FnMut(Row),
) {
    let (start, end) = (robot.origin(from), robot.origin(to));
    let length = (end - start).norm();
    if length < 1e-4 {
        return;
    }
    let now = (end - start) / length;
    columns.point(robot, to, &end, 1.0 / length);
    columns.point(robot, from, &start, -1.0 / length);
    put(direction_row(now, wanted, weight, columns));
    columns.clear();
}

/// The aim that `now`, whose derivatives are gathered in `columns`, points
/// along `wanted`.
pub(crate) fn direction_row(
    now: Vector3<f64>,
    wanted: Vector3<f64>,
    weight: f64,
    columns: &mut Columns,
) -> Row<'_> {
    columns.map(|column| column - now * now.dot(column));
    Row {
        weight,
        missed: now - wanted,
        residual: now - toward(&now, &wanted),
        columns: columns.list(),
    }
}

/// A residual no longer than Gauss-Newton can trust.
pub(crate) fn near(residual: &Vector3<f64>) -> Vector3<f64> {
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
