//! Derivatives of points and turns by the unknowns, gathered column by column.
//!
//! Unknowns are the joints, then (for a robot on its feet) shift and turn of
//! the root link in the world.

use k::nalgebra::{Isometry3, Point3, Vector3};

use crate::model::{Lever, Motion, RobotModel};
use crate::solver::Column;

/// A posed robot.
#[derive(Clone, Copy)]
pub(crate) struct Posed<'a> {
    pub model: &'a RobotModel,
    /// Of the links, in the world.
    pub poses: &'a [Isometry3<f64>],
}

impl Posed<'_> {
    /// Origin of a link.
    pub fn origin(&self, link: usize) -> Point3<f64> {
        Point3::from(self.poses[link].translation.vector)
    }

    /// Velocity of `point` per unit of the lever's joint.
    fn moves(&self, lever: &Lever, point: &Point3<f64>) -> Vector3<f64> {
        let pose = &self.poses[lever.link];
        let rate = match self.model.links[lever.link].motion {
            Motion::Turn(axis) => {
                (pose.rotation * axis.into_inner()).cross(&(point.coords - pose.translation.vector))
            }
            Motion::Slide(axis) => pose.rotation * axis.into_inner(),
            Motion::Fixed => Vector3::zeros(),
        };
        rate * lever.scale
    }
}

/// The gathered columns; each appears once.
pub(crate) struct Columns {
    joints: usize,
    list: Vec<Column>,
}

impl Columns {
    /// For `joints` joints and as many unknowns altogether.
    pub fn new(joints: usize, unknowns: usize) -> Self {
        Self {
            joints,
            list: Vec::with_capacity(unknowns),
        }
    }

    pub fn clear(&mut self) {
        self.list.clear();
    }

    pub fn list(&self) -> &[Column] {
        &self.list
    }

    /// Changes every column.
    pub fn map(&mut self, change: impl Fn(&Vector3<f64>) -> Vector3<f64>) {
        for (_, column) in &mut self.list {
            *column = change(column);
        }
    }

    /// Adds the derivatives by the joints of a point fixed to `link`, times
    /// `scale`.
    pub fn point(&mut self, robot: &Posed, link: usize, point: &Point3<f64>, scale: f64) {
        for lever in &robot.model.levers[link] {
            self.put(lever.joint, robot.moves(lever, point) * scale);
        }
    }

    /// Adds the derivatives by the root's shift and turn of a point of the robot.
    pub fn point_by_root(&mut self, robot: &Posed, point: &Point3<f64>) {
        let arm = point - robot.origin(0);
        for (axis, unit) in units().into_iter().enumerate() {
            self.put(self.joints + axis, unit);
            self.put(self.joints + 3 + axis, unit.cross(&arm));
        }
    }

    /// Adds the turning rates of `link` by the joints.
    pub fn turn(&mut self, robot: &Posed, link: usize) {
        for lever in &robot.model.levers[link] {
            if let Motion::Turn(axis) = robot.model.links[lever.link].motion {
                let rate = robot.poses[lever.link].rotation * axis.into_inner() * lever.scale;
                self.put(lever.joint, rate);
            }
        }
    }

    /// Adds the turning rates of anything by the root's turn.
    pub fn turn_by_root(&mut self) {
        for (axis, unit) in units().into_iter().enumerate() {
            self.put(self.joints + 3 + axis, unit);
        }
    }

    fn put(&mut self, index: usize, value: Vector3<f64>) {
        match self.list.iter_mut().find(|(other, _)| *other == index) {
            Some((_, sum)) => *sum += value,
            None => self.list.push((index, value)),
        }
    }
}

fn units() -> [Vector3<f64>; 3] {
    [Vector3::x(), Vector3::y(), Vector3::z()]
}
