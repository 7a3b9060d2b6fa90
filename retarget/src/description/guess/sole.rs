//! Where the undersides of feet are, and how large.

use k::nalgebra::{Point3, Unit, UnitQuaternion, Vector3};

use super::axes::BodyAxes;
use super::limb::FoundLimb;
use super::link_tree::LinkTree;
use super::shape::{corners_of, has_shapes, middle_of_mass};
use super::words::NameWords;
use crate::kinematics::{RobotModel, level_rotation};

/// Share of the ankle's height that belongs to the sole.
const UNDERSIDE: f64 = 0.4;
/// How far from its joint a foot's mass lies at most, of the way from the root to it.
const FARTHEST_MASS: f64 = 0.15;
/// Feet whose joints mirror each other by less than this are alike, metres.
const ALIKE_M: f64 = 0.01;
/// A frame named foot this near to the middle of the underside is the sole, metres.
const FRAME_M: f64 = 0.02;
/// A frame has no more mass, kg.
const FRAME_KG: f64 = 1e-6;

/// What a sole was found by, the surest last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Evidence {
    /// A foot without a shape reaches twice as far down as its mass lies.
    Mass,
    Meshes,
    Shapes,
}

/// The middle of a foot's underside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sole {
    /// In the root's frame.
    pub at: Point3<f64>,
    /// Length and width, metres, if the foot has a shape.
    pub size_m: Option<[f64; 2]>,
    /// Whether the link that ends the leg is itself the sole.
    pub is_frame: bool,
    evidence: Evidence,
}

/// The soles of two legs, left and right. Of feet that mirror each other the surer one
/// tells where both soles are.
pub(super) fn soles(body: &LinkTree, legs: [&FoundLimb; 2], axes: &BodyAxes) -> [Option<Sole>; 2] {
    let links = legs.map(|leg| leg.sole);
    let found = links.map(|link| link.and_then(|link| sole(body, link, axes)));
    let [Some(left), Some(right)] = links.map(|link| link.map(|link| foot_of(body, link))) else {
        return found;
    };
    let across = axes.up.cross(&axes.forward);
    let middle = middle_between(body, legs, &across);
    let mirrored = |at: Point3<f64>| at + across * (2.0 * (middle - at.coords.dot(&across)));
    if (mirrored(body.at(left)) - body.at(right)).norm() > ALIKE_M {
        return found;
    }
    let evidence = found.map(|sole| sole.map(|sole| sole.evidence));
    let of_other = |sole: Option<Sole>| sole.map(|sole| Sole { at: mirrored(sole.at), ..sole });
    // Meshes that do not mirror each other are turned otherwise than their maker's program
    // turns them: of such feet the frames alone are sure.
    let mirror = found[0]
        .zip(found[1])
        .is_some_and(|(left, right)| (mirrored(left.at) - right.at).norm() < ALIKE_M);
    let frame = |side: usize| {
        let (link, sole) = links[side].zip(found[side])?;
        let turned = sole.is_frame && sole.evidence == Evidence::Meshes;
        Some(if turned { Sole { at: body.at(link), size_m: None, ..sole } } else { sole })
    };
    match evidence {
        [left, right] if left == right && !mirror => [frame(0), frame(1)],
        [left, right] if left < right => [of_other(found[1]), found[1]],
        [left, right] if left > right => [found[0], of_other(found[0])],
        _ => found,
    }
}

/// How far to the left the plane between the legs lies.
fn middle_between(body: &LinkTree, legs: [&FoundLimb; 2], across: &Vector3<f64>) -> f64 {
    let tops = legs.map(|leg| leg.path.first().map_or(0.0, |&top| body.at(top).coords.dot(across)));
    f64::midpoint(tops[0], tops[1])
}

/// The first of the links that are rigid with a sole.
fn foot_of(body: &LinkTree, link: usize) -> usize {
    let drives = body.model.drives_above(link);
    let rigid = body.model.ancestors(link).take_while(|&up| body.model.drives_above(up) == drives);
    rigid.last().unwrap_or(link)
}

/// Whether a link was described as the sole: it is level when the foot is. A frame that is
/// called foot may also be the ankle's.
pub(crate) fn is_sole_frame(model: &RobotModel, link: usize) -> bool {
    let words = NameWords::of(model, link);
    let is_frame = || {
        let shapes = model.all_shapes().map(|shape| shape.link);
        let mut bodies = shapes.chain(model.meshes().iter().map(|mesh| mesh.link));
        model.links[link].mass_kg < FRAME_KG && bodies.all(|other| other != link)
    };
    let is_fixed = model.last_driven(link) != link;
    is_fixed && (words.is_sole() || (words.has(&["foot"]) && is_frame()))
}

fn sole(body: &LinkTree, link: usize, axes: &BodyAxes) -> Option<Sole> {
    let foot = foot_of(body, link);
    let corners = corners_of(body, foot);
    if !is_sole_frame(body.model, link) {
        let flat = underside(body, foot, &corners, &UnitQuaternion::identity(), axes);
        return flat.or_else(|| by_mass(body, link, foot, &axes.up));
    }
    // A robot whose legs are bent at zero holds its feet at an angle there.
    let turn = level_rotation(&body.poses[link].rotation, &Unit::new_normalize(axes.up));
    let level = underside(body, foot, &corners, &turn, axes);
    let is_near = |sole: &Sole| (sole.at - body.at(link)).norm() < FRAME_M;
    if body.words[link].is_sole() || level.as_ref().is_some_and(is_near) {
        return level.map(|sole| Sole { is_frame: true, ..sole });
    }
    underside(body, foot, &corners, &UnitQuaternion::identity(), axes)
}

/// The underside of a foot with these corners, which `turn` puts level.
fn underside(
    body: &LinkTree,
    foot: usize,
    corners: &[Point3<f64>],
    turn: &UnitQuaternion<f64>,
    axes: &BodyAxes,
) -> Option<Sole> {
    if corners.is_empty() {
        return None;
    }
    let [up, forward] = [axes.up, axes.forward].map(|axis| turn.inverse() * axis);
    let left = up.cross(&forward);
    // What touches the floor is near the underside; an ankle's casing is not.
    let height = |corner: &Point3<f64>| corner.coords.dot(&up);
    let lowest = corners.iter().map(height).fold(f64::INFINITY, f64::min);
    let ankle = height(&body.at(foot)) - lowest;
    let highest = lowest + (UNDERSIDE * ankle).max(0.005);
    let low: Vec<_> = corners.iter().filter(|corner| height(corner) <= highest).collect();
    let span = |axis: Vector3<f64>| {
        let along = low.iter().map(|corner| corner.coords.dot(&axis));
        let least = along.clone().fold(f64::INFINITY, f64::min);
        (least, along.fold(f64::NEG_INFINITY, f64::max))
    };
    let (back, front) = span(forward);
    let (right, leftmost) = span(left);
    let (bottom, _) = span(up);
    let at =
        forward * f64::midpoint(back, front) + left * f64::midpoint(right, leftmost) + up * bottom;
    let size_m = [front - back, leftmost - right].map(|size| (size * 0.95).clamp(0.005, 1.0));
    let evidence = match has_shapes(body, foot) {
        true => Evidence::Shapes,
        false => Evidence::Meshes,
    };
    Some(Sole { at: Point3::from(at), size_m: Some(size_m), is_frame: false, evidence })
}

/// A foot that is nothing but a mass beyond its joint; `None` where a link below stands for
/// the sole, or the mass lies where no foot's does.
fn by_mass(body: &LinkTree, link: usize, foot: usize, up: &Vector3<f64>) -> Option<Sole> {
    let middle = middle_of_mass(body, foot).filter(|_| body.is_moved(link))?;
    let away = middle - body.at(foot);
    let (down, most) = (-away.dot(up), FARTHEST_MASS * body.way_m(foot));
    let is_foot = down > 1e-3 && away.norm() < most;
    is_foot.then(|| Sole {
        at: middle - up * down,
        size_m: None,
        is_frame: false,
        evidence: Evidence::Mass,
    })
}
