//! The robot as a figure: x forward, y left, z up, metres.

use super::stick_figure::{Dot, Limb, Side, StickFigure};
use crate::robot::meshes::SurfacePoint;
use servodance_retarget::nalgebra::{Isometry3, Point3, Vector3};
use servodance_retarget::{RobotModel, Shape, Visual, link_sides};

/// Thickness of a link without shapes, and the most that a shape is drawn with, of the
/// robot's size.
const STICK: f64 = 0.012;
const THICKEST: f64 = 0.09;
/// Where shapes cover less of the robot's links, sticks are drawn too.
const COVERED: f64 = 0.6;
/// The shortest piece, of the robot's size, that is missed between meshes.
const GAP: f64 = 0.05;

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
    meshed_figure(model, world_from_root, positions_rad, &[])
}

/// The robot as its meshes, where they are `surface`; what they leave out as shapes and sticks.
pub fn meshed_figure(
    model: &RobotModel,
    world_from_root: &Isometry3<f64>,
    positions_rad: &[f64],
    surface: &[SurfacePoint],
) -> StickFigure {
    let poses = model.link_poses(positions_rad);
    let poses: Vec<Isometry3<f64>> = poses.iter().map(|pose| world_from_root * pose).collect();
    let sides = link_sides(model).into_iter().map(Side::from).collect();
    let mut meshed = vec![false; poses.len()];
    surface.iter().for_each(|point| meshed[point.link] = true);
    let drawn = DrawnRobot { model, poses, sides, meshed };
    let mut limbs = drawn.shapes();
    limbs.extend(drawn.sticks());
    let dots: Vec<Dot> = surface.iter().map(|point| drawn.dot(point)).collect();
    let feet = limbs.iter();
    let feet = feet.map(|limb: &Limb| limb.from[2].min(limb.to[2]) - limb.radius_m);
    let lowest = feet.chain(dots.iter().map(|dot| dot.at[2]));
    let floor_m = lowest.fold(f64::INFINITY, f64::min);
    let root = world_from_root.translation;
    StickFigure { limbs, dots, height_m: 0.0, floor_m, center: [root.x, root.y] }
}

/// A robot in a pose; everything in the world's frame.
struct DrawnRobot<'a> {
    model: &'a RobotModel,
    poses: Vec<Isometry3<f64>>,
    sides: Vec<Side>,
    /// Links that are drawn by their meshes.
    meshed: Vec<bool>,
}

impl DrawnRobot<'_> {
    fn at(&self, link: usize) -> Vector3<f64> {
        self.poses[link].translation.vector
    }

    fn size_m(&self) -> f64 {
        let away = (0..self.poses.len()).map(|link| (self.at(link) - self.at(0)).norm());
        2.0 * away.fold(0.02, f64::max)
    }

    fn shapes(&self) -> Vec<Limb> {
        let thickest_m = THICKEST * self.size_m();
        let visuals = self.model.visuals().iter().filter(|visual| !self.meshed[visual.link]);
        let limb = |visual: &Visual| {
            let world_from_visual = self.poses[visual.link] * visual.pose_in_link;
            let (half_axis, radius_m) = axis_of(&visual.shape);
            let end = |sign: f64| {
                let point = world_from_visual * Point3::from(half_axis.map(|v| v * sign));
                [point.x, point.y, point.z]
            };
            Limb {
                from: end(-1.0),
                to: end(1.0),
                radius_m: radius_m.min(thickest_m),
                side: self.sides[visual.link],
            }
        };
        visuals.map(limb).collect()
    }

    /// Sticks between links where shapes cover little of the robot, and beside meshes that
    /// leave a long piece out.
    fn sticks(&self) -> Vec<Limb> {
        let size_m = self.size_m();
        let length_m = |&(from, to): &(usize, usize)| (self.at(from) - self.at(to)).norm();
        let has_shape = |link: usize| self.model.visuals().iter().any(|shape| shape.link == link);
        let is_covered = |&(from, _): &(usize, usize)| self.meshed[from] || has_shape(from);
        let mut segments = self.model.segments().to_vec();
        segments.retain(|segment| length_m(segment) > STICK * size_m);
        let covered = segments.iter().filter(|segment| is_covered(segment)).count();
        let is_whole = match self.meshed.contains(&true) {
            true => segments.iter().all(|it| is_covered(it) || length_m(it) < GAP * size_m),
            false => covered as f64 >= COVERED * segments.len() as f64,
        };
        segments.retain(|segment| !is_whole && !self.meshed[segment.0]);
        let stick = |(from, to): (usize, usize)| Limb {
            from: self.at(from).into(),
            to: self.at(to).into(),
            radius_m: STICK * size_m,
            side: self.sides[to],
        };
        segments.into_iter().map(stick).collect()
    }

    fn dot(&self, point: &SurfacePoint) -> Dot {
        let pose = self.poses[point.link];
        let at = pose * point.at;
        let normal = pose.rotation * point.normal;
        Dot { at: [at.x, at.y, at.z], normal: normal.into(), side: self.sides[point.link] }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Three pieces of 0.2 m, whose names tell a side once, and no shapes.
    fn arm() -> RobotModel {
        let joint = |name: &str, parent: &str| {
            format!(
                r#"<link name="{name}"/><joint name="{name}_turn" type="revolute"><parent
                link="{parent}"/><child link="{name}"/><origin xyz="0 0 -0.2"/><axis xyz="0 1 0"/>
                <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"#
            )
        };
        let links = joint("ARM_L", "base") + &joint("fist", "ARM_L") + &joint("thumb", "fist");
        let urdf = format!(r#"<robot name="r"><link name="base"/>{links}</robot>"#);
        RobotModel::new(&urdf, &["ARM_L_turn", "fist_turn", "thumb_turn"]).unwrap()
    }

    fn drawn(meshed: &[usize]) -> StickFigure {
        let on = |&link: &usize| SurfacePoint { link, at: Point3::origin(), normal: Vector3::z() };
        let surface: Vec<SurfacePoint> = meshed.iter().map(on).collect();
        meshed_figure(&arm(), &Isometry3::identity(), &[0.0; 3], &surface)
    }

    #[test]
    fn what_meshes_leave_out_is_drawn_as_sticks() {
        assert_eq!(drawn(&[]).limbs.len(), 3);
        let hand = drawn(&[2, 3]);
        assert_eq!((hand.limbs.len(), hand.dots.len()), (2, 2));
        assert!(drawn(&[0, 1, 2, 3]).limbs.is_empty());
    }

    #[test]
    fn a_link_without_a_side_has_that_of_the_link_that_carries_it() {
        assert!(drawn(&[]).limbs.iter().all(|limb| limb.side == Side::Left));
    }
}
