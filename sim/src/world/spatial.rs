//! Spatial vectors and inertias (Featherstone, Rigid Body Dynamics Algorithms,
//! 2008), all in world axes about one common point.

use nalgebra::{Matrix3, Vector3};

pub(super) type Vec3 = Vector3<f64>;
pub(super) type Mat3 = Matrix3<f64>;

/// A velocity or acceleration: angular part, and linear part of the body's
/// point at the common point.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Twist {
    pub angular: Vec3,
    pub linear: Vec3,
}

/// A force and its moment about the common point.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wrench {
    pub moment: Vec3,
    pub force: Vec3,
}

impl Twist {
    pub fn plus(self, other: Self) -> Self {
        Self { angular: self.angular + other.angular, linear: self.linear + other.linear }
    }

    pub fn times(self, scale: f64) -> Self {
        Self { angular: self.angular * scale, linear: self.linear * scale }
    }

    /// The change of `moved` by being carried along with `self`.
    pub fn cross(self, moved: Self) -> Self {
        Self {
            angular: self.angular.cross(&moved.angular),
            linear: self.angular.cross(&moved.linear) + self.linear.cross(&moved.angular),
        }
    }

    /// The same for a momentum.
    pub fn cross_momentum(self, momentum: Wrench) -> Wrench {
        Wrench {
            moment: self.angular.cross(&momentum.moment) + self.linear.cross(&momentum.force),
            force: self.angular.cross(&momentum.force),
        }
    }

    pub fn power(self, wrench: Wrench) -> f64 {
        self.angular.dot(&wrench.moment) + self.linear.dot(&wrench.force)
    }

    /// Velocity of the body's point that is `at` from the common point.
    pub fn at(self, at: Vec3) -> Vec3 {
        self.linear + self.angular.cross(&at)
    }
}

impl Wrench {
    pub fn plus(self, other: Self) -> Self {
        Self { moment: self.moment + other.moment, force: self.force + other.force }
    }

    /// A force that acts `at` from the common point.
    pub fn of_force(force: Vec3, at: Vec3) -> Self {
        Self { moment: at.cross(&force), force }
    }
}

/// Inertia about the common point.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SpatialInertia {
    pub mass: f64,
    /// Mass times the way to the centre of mass.
    pub first: Vec3,
    pub second: Mat3,
}

impl SpatialInertia {
    /// Of a body whose centre of mass is `com` from the common point; `inertia`
    /// is about that centre, in world axes.
    pub fn new(mass: f64, com: Vec3, inertia: Mat3) -> Self {
        let shifted = (Mat3::identity() * com.norm_squared() - com * com.transpose()) * mass;
        Self { mass, first: com * mass, second: inertia + shifted }
    }

    pub fn plus(self, other: Self) -> Self {
        Self {
            mass: self.mass + other.mass,
            first: self.first + other.first,
            second: self.second + other.second,
        }
    }

    pub fn times(self, twist: Twist) -> Wrench {
        Wrench {
            moment: self.second * twist.angular + self.first.cross(&twist.linear),
            force: twist.linear * self.mass - self.first.cross(&twist.angular),
        }
    }
}

/// Rotation about a unit axis (Rodrigues), by functions whose bits are the same
/// on every processor.
pub(super) fn rotation(axis: &Vec3, angle: f64) -> Mat3 {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let cross = axis.cross_matrix();
    Mat3::identity() + cross * sin + cross * cross * (1.0 - cos)
}

/// Rotation by a vector: axis times angle.
pub(super) fn rotation_by(turn: &Vec3) -> Mat3 {
    let angle = turn.norm();
    match angle > 1e-12 {
        true => rotation(&(turn / angle), angle),
        false => Mat3::identity() + turn.cross_matrix(),
    }
}

/// The nearest rotation to one with rounding errors (one step of Gram and Schmidt).
pub(super) fn orthonormal(near: &Mat3) -> Mat3 {
    let x = near.column(0).normalize();
    let y = near.column(1) - x * x.dot(&near.column(1));
    let y = y.normalize();
    Mat3::from_columns(&[x, y, x.cross(&y)])
}
