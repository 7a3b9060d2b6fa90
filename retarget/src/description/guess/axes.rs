//! Up and forward in the root link's frame.

use k::nalgebra::{Point3, Vector3};

use super::limb::{FoundLimb, mean};
use super::link_tree::LinkTree;

/// A trunk from hips to shoulders of less than this share of the legs tells no way.
const LEAST_TRUNK: f64 = 0.2;
/// Cosine of the farthest that a trunk leans.
const UPRIGHT: f64 = 0.8;
/// Cosine of what lies in one line.
const IN_LINE: f64 = 0.95;

/// Axes of the root link that point forward and up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BodyAxes {
    pub forward: Vector3<f64>,
    pub up: Vector3<f64>,
    /// Whether it was seen, or only assumed.
    pub seen: bool,
}

impl BodyAxes {
    /// x forward, z up: what is assumed.
    pub fn usual() -> Self {
        Self { forward: Vector3::x(), up: Vector3::z(), seen: false }
    }

    /// As a robot file says it: `x`, `-y`, …
    pub fn name(axis: &Vector3<f64>) -> &'static str {
        let names = [["x", "-x"], ["y", "-y"], ["z", "-z"]];
        let at = axis.iamax();
        names[at][usize::from(axis[at] < 0.0)]
    }

    /// Whether the root link looks along x and z is up.
    pub fn is_usual(&self) -> bool {
        self.forward == Vector3::x() && self.up == Vector3::z()
    }
}

/// Whether base, shoulders and head lie in one line: then that is up, whatever z is.
fn stands_in_line(body: &LinkTree, shoulders: Option<Point3<f64>>, head: Option<usize>) -> bool {
    let Some((shoulders, head)) = shoulders.zip(head) else { return false };
    let ways = [shoulders - body.at(0), body.at(head) - shoulders];
    let axis = nearest_axis(ways[0]);
    ways.iter().all(|way| way.norm() > 5e-2 && way.dot(&axis) > IN_LINE * way.norm())
}

fn nearest_axis(direction: Vector3<f64>) -> Vector3<f64> {
    let at = direction.iamax();
    let mut axis = Vector3::zeros();
    axis[at] = direction[at].signum();
    axis
}

pub(super) fn find(
    body: &LinkTree,
    arms: &[FoundLimb; 2],
    legs: &[FoundLimb; 2],
    head: Option<usize>,
    chest: usize,
    reasons: &mut Vec<String>,
) -> BodyAxes {
    let tops = |limbs: &[FoundLimb; 2]| {
        let [left, right] = [0, 1].map(|i| limbs[i].top.map(|link| body.at(link)));
        left.zip(right)
    };
    let pairs = [tops(arms), tops(legs)];
    let across: Vector3<f64> = pairs.iter().flatten().map(|(left, right)| left - right).sum();
    if across.norm() < 1e-3 {
        reasons.push("no pair of limbs to see forward by: x forward, z up are assumed".into());
        return BodyAxes::usual();
    }
    let left = nearest_axis(across);
    let both = |pair: &Option<(Point3<f64>, Point3<f64>)>| {
        pair.as_ref().map(|(left, right)| Point3::from((left.coords + right.coords) * 0.5))
    };
    let shoulders = both(&pairs[0]);
    let hips = both(&pairs[1]);
    let feet: Vec<_> = legs.iter().filter_map(|leg| leg.path.last()).map(|&l| body.at(l)).collect();
    let top = shoulders.or(head.map(|head| body.at(head)));
    let flat = |way: Vector3<f64>| way - left * left.dot(&way);
    let trunk = shoulders.zip(hips).map_or_else(Vector3::zeros, |(top, hips)| flat(top - hips));
    let is_straight = trunk.amax() > UPRIGHT * trunk.norm();
    let trunk_m = if is_straight { trunk.norm() } else { 0.0 };
    let upward = match (hips, mean(&feet), top) {
        // Legs may be folded at zero, and what carries the limbs is the same at any angles.
        (Some(hips), Some(feet), _) if trunk_m > LEAST_TRUNK * (hips - feet).norm() => trunk,
        (Some(hips), Some(feet), _) if (hips - feet).norm() > 1e-2 => hips - feet,
        // Where shoulders lie to the base says little: z is up, unless the arms lie along it.
        _ if left.z == 0.0 && !stands_in_line(body, shoulders, head) => Vector3::z(),
        // A head may look out ahead of the shoulders, which are above the base in any case.
        (_, _, Some(top)) if (top - body.at(0)).norm() > 5e-2 => top - body.at(0),
        (_, _, Some(top)) => match head.map(|head| body.at(head) - top) {
            Some(neck) if neck.norm() > 1e-2 => neck,
            _ => top - body.at(chest),
        },
        _ => Vector3::z(),
    };
    // What lies across is not up.
    let upward = flat(upward);
    let up = match upward.norm() > 1e-2 {
        true => nearest_axis(upward),
        false if left.z == 0.0 => Vector3::z(),
        false => Vector3::y(),
    };
    let forward = left.cross(&up);
    reasons.push(format!(
        "left is {} of the root link (from right to left limbs) and up is {}: so forward is {}",
        BodyAxes::name(&left),
        BodyAxes::name(&up),
        BodyAxes::name(&forward)
    ));
    BodyAxes { forward, up, seen: true }
}
