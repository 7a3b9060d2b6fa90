//! Wheels that can turn the base.

use super::kind::{Confidence, KindGuess};
use super::link_tree::LinkTree;
use super::shape::corners_of;
use crate::config::BodyKind;
use crate::kinematics::JointMotion;
use k::nalgebra::{Point3, Vector3};

/// Most wheels that one base has.
const MOST: usize = 8;
/// Steepest axle that still counts as level: sine of its angle.
const LEVEL: f64 = 0.1;
/// Cosine of the way from one wheel to the other against their axle.
const ON_AXLE: f64 = 0.95;
/// Smallest radius of a wheel, metres.
const SMALLEST_M: f64 = 1e-3;

/// A wheel that can turn the base.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DrivenWheel {
    pub link: String,
    /// `None` where no shape tells it.
    pub radius_m: Option<f64>,
}

/// Whether a joint turns about a level axle, of a body whose root has z up.
pub(super) fn is_axle(body: &LinkTree, link: usize) -> bool {
    let JointMotion::Revolute(axis) = body.model.links[link].motion else { return false };
    (body.poses[link].rotation * axis.into_inner()).z.abs() < LEVEL
}

/// Takes out links of one joint that are beside each other on one level axle: wheels, whatever
/// they are called.
pub(super) fn leave_out_pairs(body: &LinkTree, links: &mut Vec<usize>) {
    let axle = |link: usize| match body.model.links[link].motion {
        JointMotion::Revolute(axis) => body.poses[link].rotation * axis.into_inner(),
        _ => Vector3::zeros(),
    };
    let share_axle = |one: usize, other: usize| {
        let apart = body.at(one) - body.at(other);
        let along = |link: usize| apart.dot(&axle(link)).abs() > ON_AXLE * apart.norm();
        one != other && body.carrier(one) == body.carrier(other) && along(one) && along(other)
    };
    let all = links.clone();
    links
        .retain(|&link| !(is_axle(body, link) && all.iter().any(|&other| share_axle(link, other))));
}

/// The driven wheels of a base, by their names: on level axles on the base itself. None
/// where a wheel is steered, or hangs on a leg.
pub(super) fn driven_wheels(body: &LinkTree, up: &Vector3<f64>) -> Vec<DrivenWheel> {
    let is_driven = |link: &usize| {
        let words = &body.words[*link];
        body.is_moved(*link) && words.is_wheel() && !words.is_caster()
    };
    let links: Vec<usize> = (1..body.model.links.len()).filter(is_driven).collect();
    let on_base = links.iter().all(|&link| {
        let JointMotion::Revolute(axis) = body.model.links[link].motion else { return false };
        let axle = body.poses[link].rotation * axis.into_inner();
        body.model.drives_above(link) == 1 && axle.dot(up).abs() < LEVEL
    });
    if !on_base || !(2..=MOST).contains(&links.len()) {
        return Vec::new();
    }
    let wheel = |link: usize| {
        let depth = |corner: &Point3<f64>| (body.at(link) - corner).dot(up);
        let radius_m = corners_of(body, link).iter().map(depth).fold(0.0, f64::max);
        DrivenWheel {
            link: body.model.link_names()[link].clone(),
            radius_m: (radius_m > SMALLEST_M).then(|| (radius_m * 1e4).round() / 1e4),
        }
    };
    links.into_iter().map(wheel).collect()
}

/// The kind of a body that moves by its wheels alone.
pub(super) fn wheeled(wheels: &[DrivenWheel]) -> Option<KindGuess> {
    (!wheels.is_empty()).then(|| KindGuess {
        kind: BodyKind::Wheeled,
        confidence: Confidence::Medium,
        reason: format!("{} driven wheels by names, no arm, leg or head", wheels.len()),
    })
}
