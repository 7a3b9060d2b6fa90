//! The robot as a figure: x forward, y left, z up, metres.

use super::stick_figure::{Dot, Limb, Side, StickFigure};
use crate::robot::meshes::SurfacePoint;
use servodance_retarget::nalgebra::{Isometry3, Point3};
use servodance_retarget::{RobotModel, Shape};

/// Thickness of a link without shapes, and the most that a shape is drawn with, of the
/// robot's size.
const STICK: f64 = 0.012;
const THICKEST: f64 = 0.09;
/// Where shapes cover less of the robot's links, sticks are drawn too.
const COVERED: f64 = 0.6;

/// Height of the robot in a pose: one scale for all its poses.
pub fn standing_height_m(
    model: &RobotModel,
    world_from_root: &Isometry3<f64>,
    positions_rad: &[f64],
) -> f64 {
    let standing = robot_figure(model, world_from_root, positions_rad);
    let tops = standing.limbs.iter();
    let tops = tops.map(|limb| limb.from[2].max(limb.to[2]) + limb.radius_m);
    let highest = tops.fold(f64::NEG_INFINITY, f64::max);
    (highest - standing.floor_m).max(0.1) * 1.1
}

/// The robot as its visual shapes, each drawn along its longest side; as sticks
/// between its links where it has none.
pub fn robot_figure(
    model: &RobotModel,
    world_from_root: &Isometry3<f64>,
    positions_rad: &[f64],
) -> StickFigure {
    let poses = model.link_poses(positions_rad);
    let mut limbs = Vec::new();
    for visual in model.visuals() {
        let world_from_visual = world_from_root * poses[visual.link] * visual.pose_in_link;
        let (half_axis, radius_m) = axis_of(&visual.shape);
        let end = |sign: f64| {
            let point = world_from_visual * Point3::from(half_axis.map(|v| v * sign));
            [point.x, point.y, point.z]
        };
        limbs.push(Limb {
            from: end(-1.0),
            to: end(1.0),
            radius_m,
            side: Side::of(&model.link_names()[visual.link]),
        });
    }
    let at = |link: usize| (world_from_root * poses[link]).translation.vector;
    let middle = at(0);
    let size_m = 2.0 * (0..poses.len()).map(|link| (at(link) - middle).norm()).fold(0.02, f64::max);
    for limb in &mut limbs {
        limb.radius_m = limb.radius_m.min(THICKEST * size_m);
    }
    let long = |&&(from, to): &&(usize, usize)| (at(from) - at(to)).norm() > STICK * size_m;
    let segments: Vec<(usize, usize)> = model.segments().iter().filter(long).copied().collect();
    let has_shape = |link: usize| model.visuals().iter().any(|visual| visual.link == link);
    let covered = segments.iter().filter(|(from, _)| has_shape(*from)).count();
    if (covered as f64) < COVERED * segments.len() as f64 {
        limbs.extend(segments.iter().map(|&(from, to)| Limb {
            from: at(from).into(),
            to: at(to).into(),
            radius_m: STICK * size_m,
            side: Side::of(&model.link_names()[to]),
        }));
    }
    let feet = limbs.iter();
    let feet = feet.map(|limb: &Limb| limb.from[2].min(limb.to[2]) - limb.radius_m);
    let floor_m = feet.fold(f64::INFINITY, f64::min);
    let root = world_from_root.translation;
    let center = [root.x, root.y];
    StickFigure { limbs, dots: Vec::new(), height_m: 0.0, floor_m, center }
}

/// The robot as its meshes, where they are `surface`; as by [`robot_figure`] without any.
pub fn meshed_figure(
    model: &RobotModel,
    world_from_root: &Isometry3<f64>,
    positions_rad: &[f64],
    surface: &[SurfacePoint],
) -> StickFigure {
    let mut figure = robot_figure(model, world_from_root, positions_rad);
    if surface.is_empty() {
        return figure;
    }
    let poses = model.link_poses(positions_rad);
    let side: Vec<Side> = model.link_names().iter().map(|name| Side::of(name)).collect();
    figure.limbs.clear();
    figure.dots.extend(surface.iter().map(|point| {
        let pose = world_from_root * poses[point.link];
        let at = pose * point.at;
        let normal = pose.rotation * point.normal;
        Dot { at: [at.x, at.y, at.z], normal: normal.into(), side: side[point.link] }
    }));
    let heights = figure.dots.iter().map(|dot| dot.at[2]);
    figure.floor_m = heights.fold(f64::INFINITY, f64::min);
    figure
}

/// The radius, and half the longest side as a vector, less the drawn ends' rounding.
fn axis_of(shape: &Shape) -> ([f64; 3], f64) {
    match *shape {
        Shape::Sphere { radius_m } => ([0.0, 0.0, 1e-4], radius_m),
        Shape::Cylinder { radius_m, length_m } => {
            ([0.0, 0.0, (length_m / 2.0 - radius_m).max(1e-4)], radius_m)
        }
        Shape::Box { size_m } => {
            let longest = (0..3).fold(0, |a, b| if size_m[b] > size_m[a] { b } else { a });
            let others: Vec<f64> = (0..3).filter(|i| *i != longest).map(|i| size_m[i]).collect();
            let radius_m = (others[0] + others[1]) / 4.0;
            let mut axis = [0.0; 3];
            axis[longest] = (size_m[longest] / 2.0 - radius_m).max(1e-4);
            (axis, radius_m)
        }
    }
}
