//! Derivatives of points and turns by the unknowns, gathered column by column.
//!
//! Unknowns are the joints, then (for a robot on its feet) shift and turn of
//! the root link in the world.

use crate::kinematics::{DrivenAncestor, JointMotion, RobotModel, Twist};
use crate::solver::JacobianColumn;
use k::nalgebra::{Isometry3, Point3, Vector3};

#[derive(Clone, Copy)]
pub(crate) struct PosedRobot<'a> {
    pub model: &'a RobotModel,
    pub poses: &'a [Isometry3<f64>],
    /// Of the plate of a platform, for each crank.
    twists: Option<[Twist; 6]>,
}

impl<'a> PosedRobot<'a> {
    pub fn new(model: &'a RobotModel, poses: &'a [Isometry3<f64>]) -> Self {
        let twists = model.platform.as_ref().map(|platform| platform.twists(poses));
        Self { model, poses, twists }
    }

    /// Velocity of the platform's plate for the ancestor's crank.
    fn twist(&self, ancestor: &DrivenAncestor) -> Option<&Twist> {
        let mut rods = self.model.platform.as_ref()?.rods.iter();
        let rod = rods.position(|rod| rod.drive.joint == ancestor.joint)?;
        self.twists.as_ref().map(|twists| &twists[rod])
    }

    pub fn origin(&self, link: usize) -> Point3<f64> {
        Point3::from(self.poses[link].translation.vector)
    }

    /// Velocity of `point` per unit of the ancestor's joint.
    pub fn velocity(&self, ancestor: &DrivenAncestor, point: &Point3<f64>) -> Vector3<f64> {
        let pose = &self.poses[ancestor.link];
        let rate = match self.model.links[ancestor.link].motion {
            JointMotion::Revolute(axis) => {
                (pose.rotation * axis.into_inner()).cross(&(point.coords - pose.translation.vector))
            }
            JointMotion::Prismatic(axis) => pose.rotation * axis.into_inner(),
            JointMotion::Platform => self.twist(ancestor).map_or(Vector3::zeros(), |twist| {
                twist.shift + twist.turn.cross(&(point.coords - pose.translation.vector))
            }),
            JointMotion::Fixed => Vector3::zeros(),
        };
        rate * ancestor.scale
    }
}

pub(crate) struct Jacobian {
    joints: usize,
    columns: Vec<JacobianColumn>,
}

impl Jacobian {
    /// For `joints` joints and as many unknowns altogether.
    pub fn new(joints: usize, unknowns: usize) -> Self {
        Self { joints, columns: Vec::with_capacity(unknowns) }
    }

    pub fn clear(&mut self) {
        self.columns.clear();
    }

    pub fn columns(&self) -> &[JacobianColumn] {
        &self.columns
    }

    pub fn map(&mut self, change: impl Fn(&Vector3<f64>) -> Vector3<f64>) {
        for (_, column) in &mut self.columns {
            *column = change(column);
        }
    }

    /// Adds the derivatives by the joints of a point fixed
    /// to `link`, times `scale`.
    pub fn add_point(&mut self, robot: &PosedRobot, link: usize, point: &Point3<f64>, scale: f64) {
        for ancestor in &robot.model.driven_ancestors[link] {
            self.add(ancestor.joint, robot.velocity(ancestor, point) * scale);
        }
    }

    /// Adds the derivatives by the root's shift and turn of a point of the robot.
    pub fn add_point_by_root(&mut self, robot: &PosedRobot, point: &Point3<f64>) {
        let arm = point - robot.origin(0);
        for (axis, unit) in units().into_iter().enumerate() {
            self.add(self.joints + axis, unit);
            self.add(self.joints + 3 + axis, unit.cross(&arm));
        }
    }

    /// Adds the turning rates of `link` by the joints.
    pub fn add_rotation(&mut self, robot: &PosedRobot, link: usize) {
        for ancestor in &robot.model.driven_ancestors[link] {
            let rate = match robot.model.links[ancestor.link].motion {
                JointMotion::Revolute(axis) => {
                    robot.poses[ancestor.link].rotation * axis.into_inner() * ancestor.scale
                }
                JointMotion::Platform => match robot.twist(ancestor) {
                    Some(twist) => twist.turn,
                    None => continue,
                },
                JointMotion::Fixed | JointMotion::Prismatic(_) => continue,
            };
            self.add(ancestor.joint, rate);
        }
    }

    /// Adds the turning rates of anything by the root's turn.
    pub fn add_rotation_by_root(&mut self) {
        for (axis, unit) in units().into_iter().enumerate() {
            self.add(self.joints + 3 + axis, unit);
        }
    }

    fn add(&mut self, index: usize, value: Vector3<f64>) {
        match self.columns.iter_mut().find(|(other, _)| *other == index) {
            Some((_, sum)) => *sum += value,
            None => self.columns.push((index, value)),
        }
    }
}

fn units() -> [Vector3<f64>; 3] {
    [Vector3::x(), Vector3::y(), Vector3::z()]
}
