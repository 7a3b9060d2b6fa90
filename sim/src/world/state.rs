//! Where everything is, how it moves, and what follows from that for one step.

use super::contact::PointMotion;
use super::mass_matrix::MassMatrix;
use super::spatial::{
    Mat3, SpatialInertia, Twist, Vec3, Wrench, orthonormal, rotation, rotation_by,
};
use super::tree::{ROOT_DOFS, Tree};

/// Positions and velocities, by body; body 0 is the root.
#[derive(Clone, Debug)]
pub(super) struct WorldState {
    pub root_at: Vec3,
    pub root: Mat3,
    /// Of the root: angular, and linear at the root's origin.
    pub twist: Twist,
    pub angle: Vec<f64>,
    pub rate: Vec<f64>,
}

impl WorldState {
    pub fn new(bodies: usize) -> Self {
        Self {
            root_at: Vec3::zeros(),
            root: Mat3::identity(),
            twist: Twist::default(),
            angle: vec![0.0; bodies],
            rate: vec![0.0; bodies],
        }
    }

    pub fn rest(&mut self) {
        *self = Self::new(self.angle.len());
    }

    /// Semi-implicit Euler: velocities first, then positions with them.
    pub fn advance(&mut self, acceleration: &[f64], dt_s: f64, tree: &Tree) {
        let change = |first: usize| {
            Vec3::new(acceleration[first], acceleration[first + 1], acceleration[first + 2]) * dt_s
        };
        self.twist.angular += change(0);
        self.twist.linear += change(3);
        let moved = self.twist.linear * dt_s;
        self.root_at += moved;
        self.root = orthonormal(&(rotation_by(&(self.twist.angular * dt_s)) * self.root));
        // The common point moves along with the root.
        self.twist.linear += self.twist.angular.cross(&moved);
        for body in 1..tree.bodies.len() {
            self.rate[body] += acceleration[Tree::dof(body)] * dt_s;
            self.angle[body] += self.rate[body] * dt_s;
        }
    }
}

/// Poses, velocities and inertias of the bodies, about the root's origin.
#[derive(Clone, Debug)]
pub(super) struct Posed {
    rotation: Vec<Mat3>,
    at: Vec<Vec3>,
    /// How each body moves against its parent for one unit of its joint's speed.
    motion: Vec<Twist>,
    pub velocity: Vec<Twist>,
    pub inertia: Vec<SpatialInertia>,
    composite: Vec<SpatialInertia>,
}

impl Posed {
    pub fn new(bodies: usize) -> Self {
        Self {
            rotation: vec![Mat3::identity(); bodies],
            at: vec![Vec3::zeros(); bodies],
            motion: vec![Twist::default(); bodies],
            velocity: vec![Twist::default(); bodies],
            inertia: vec![SpatialInertia::default(); bodies],
            composite: vec![SpatialInertia::default(); bodies],
        }
    }

    /// Forward kinematics of all bodies.
    pub fn pose(&mut self, tree: &Tree, state: &WorldState) {
        for (index, body) in tree.bodies.iter().enumerate() {
            if index == 0 {
                self.rotation[0] = state.root;
                self.at[0] = Vec3::zeros();
            } else {
                let parent = self.rotation[body.parent];
                let turned = parent * body.rotation;
                let axis = turned * body.axis;
                let at = self.at[body.parent] + parent * body.at;
                if body.slides {
                    self.rotation[index] = turned;
                    self.at[index] = at + axis * state.angle[index];
                    self.motion[index] = Twist { angular: Vec3::zeros(), linear: axis };
                } else {
                    self.rotation[index] = turned * rotation(&body.axis, state.angle[index]);
                    self.at[index] = at;
                    self.motion[index] = Twist { angular: axis, linear: at.cross(&axis) };
                }
            }
            let turned = &self.rotation[index];
            let inertia = turned * body.inertia * turned.transpose();
            let com = self.at[index] + turned * body.com;
            self.inertia[index] = SpatialInertia::new(body.mass, com, inertia);
        }
        self.move_on(tree, state);
    }

    fn move_on(&mut self, tree: &Tree, state: &WorldState) {
        self.velocity[0] = state.twist;
        for (index, body) in tree.bodies.iter().enumerate().skip(1) {
            let own = self.motion[index].times(state.rate[index]);
            self.velocity[index] = self.velocity[body.parent].plus(own);
        }
    }

    /// Forces that would be needed for no acceleration at all: gravity, and what
    /// velocities cause; `push` acts on the root.
    pub fn bias(&self, tree: &Tree, push: Wrench) -> Vec<f64> {
        let gravity = Vec3::z() * super::GRAVITY_M_S2;
        let bodies = tree.bodies.len();
        let mut acceleration = vec![Twist { angular: Vec3::zeros(), linear: gravity }; bodies];
        let mut wrench = vec![Wrench::default(); bodies];
        for (index, body) in tree.bodies.iter().enumerate() {
            let velocity = self.velocity[index];
            if index > 0 {
                // The parent's velocity and the whole one give the same product.
                let own = Twist {
                    angular: velocity.angular - self.velocity[body.parent].angular,
                    linear: velocity.linear - self.velocity[body.parent].linear,
                };
                acceleration[index] = acceleration[body.parent].plus(velocity.cross(own));
            }
            let inertia = self.inertia[index];
            let momentum = inertia.times(velocity);
            wrench[index] =
                inertia.times(acceleration[index]).plus(velocity.cross_momentum(momentum));
        }
        wrench[0].moment -= push.moment;
        wrench[0].force -= push.force;
        let mut bias = vec![0.0; tree.dofs()];
        for index in (1..bodies).rev() {
            bias[Tree::dof(index)] = self.motion[index].power(wrench[index]);
            let parent = tree.bodies[index].parent;
            wrench[parent] = wrench[parent].plus(wrench[index]);
        }
        bias[..3].copy_from_slice(wrench[0].moment.as_slice());
        bias[3..ROOT_DOFS].copy_from_slice(wrench[0].force.as_slice());
        bias
    }

    /// By composite rigid bodies, from the leaves.
    pub fn mass_matrix(&mut self, tree: &Tree, mass: &mut MassMatrix) {
        mass.clear();
        self.composite.copy_from_slice(&self.inertia);
        for index in (1..tree.bodies.len()).rev() {
            let parent = tree.bodies[index].parent;
            self.composite[parent] = self.composite[parent].plus(self.composite[index]);
        }
        for index in 1..tree.bodies.len() {
            let dof = Tree::dof(index);
            let wrench = self.composite[index].times(self.motion[index]);
            let mut above = index;
            while above != 0 {
                mass.set(dof, Tree::dof(above), self.motion[above].power(wrench));
                above = tree.bodies[above].parent;
            }
            for axis in 0..3 {
                mass.set(dof, axis, wrench.moment[axis]);
                mass.set(dof, axis + 3, wrench.force[axis]);
            }
        }
        for column in 0..ROOT_DOFS {
            let mut unit = Twist::default();
            match column < 3 {
                true => unit.angular[column] = 1.0,
                false => unit.linear[column - 3] = 1.0,
            }
            let wrench = self.composite[0].times(unit);
            for row in column..ROOT_DOFS {
                let value = if row < 3 { wrench.moment[row] } else { wrench.force[row - 3] };
                mass.set(row, column, value);
            }
        }
    }

    /// Inertia about its own axis of what a joint carries.
    pub fn subtree_inertia(&self, body: usize) -> f64 {
        self.motion[body].power(self.composite[body].times(self.motion[body]))
    }

    /// Where a point is, from the root's origin.
    pub fn point(&self, tree: &Tree, point: usize) -> Vec3 {
        let point = &tree.points[point];
        self.at[point.body] + self.rotation[point.body] * point.at
    }

    pub fn com(&self, tree: &Tree, body: usize) -> Vec3 {
        self.at[body] + self.rotation[body] * tree.bodies[body].com
    }
}

impl PointMotion for Posed {
    fn along(&self, dof: usize, axis: &Vec3, at: &Vec3) -> f64 {
        match dof {
            0..3 => at.cross(axis)[dof],
            3..ROOT_DOFS => axis[dof - 3],
            _ => self.motion[dof + 1 - ROOT_DOFS].at(*at).dot(axis),
        }
    }
}
