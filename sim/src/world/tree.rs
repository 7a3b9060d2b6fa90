//! The robot's links as moving bodies: fixed joints are merged, each driven
//! joint is one degree of freedom behind the six of the root.

use servodance_types::{LinkDrive, LinkMotion, Placement, RigidLink};

use super::spatial::{Mat3, SpatialInertia, Vec3};
use crate::error::SimError;

/// Degrees of freedom of the root: turn and shift in world axes.
pub(super) const ROOT_DOFS: usize = 6;

#[derive(Clone, Debug)]
pub(super) struct Body {
    pub parent: usize,
    pub rotation: Mat3,
    pub at: Vec3,
    /// Joint axis in the joint's frame.
    pub axis: Vec3,
    pub slides: bool,
    pub drive: LinkDrive,
    pub mass: f64,
    /// Centre of mass and inertia about it, in the body's frame.
    pub com: Vec3,
    pub inertia: Mat3,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct BodyPoint {
    pub body: usize,
    pub at: Vec3,
    pub radius: f64,
    pub foot: Option<usize>,
}

/// Body 0 is the root, which has no joint.
#[derive(Clone, Debug)]
pub(super) struct Tree {
    pub bodies: Vec<Body>,
    pub points: Vec<BodyPoint>,
    pub mass: f64,
}

fn matrix(rows: &[[f64; 3]; 3]) -> Mat3 {
    Mat3::from_fn(|row, column| rows[row][column])
}

impl Tree {
    /// Fails, by link, where a figure cannot be simulated.
    pub fn new(links: &[RigidLink]) -> Result<Self, SimError> {
        let mut tree = Self { bodies: Vec::new(), points: Vec::new(), mass: 0.0 };
        // Where each link is in the body that it is merged into.
        let mut place: Vec<(usize, Mat3, Vec3)> = Vec::with_capacity(links.len());
        for link in links {
            check(link, place.len())?;
            let Placement { rotation, at_m } = &link.origin;
            let (rotation, at) = (matrix(rotation), Vec3::from(*at_m));
            let (body, rotation, at) = match link.parent {
                Some(parent) => {
                    let (body, turned, shifted) = &place[parent];
                    (*body, turned * rotation, shifted + turned * at)
                }
                None => (0, Mat3::identity(), Vec3::zeros()),
            };
            let moving = match (link.motion, link.drive) {
                (LinkMotion::Revolute(axis), Some(drive)) => Some((axis, false, drive)),
                (LinkMotion::Prismatic(axis), Some(drive)) => Some((axis, true, drive)),
                _ => None,
            };
            let here = match moving {
                Some((axis, slides, drive)) if link.parent.is_some() => {
                    tree.bodies.push(Body {
                        parent: body,
                        rotation,
                        at,
                        axis: Vec3::from(axis),
                        slides,
                        drive,
                        ..Body::still()
                    });
                    (tree.bodies.len() - 1, Mat3::identity(), Vec3::zeros())
                }
                _ => (body, rotation, at),
            };
            if tree.bodies.is_empty() {
                tree.bodies.push(Body::still());
            }
            tree.merge(link, here);
            place.push(here);
        }
        tree.mass = tree.bodies.iter().map(|body| body.mass).sum();
        match tree.mass > 0.0 {
            true => Ok(tree),
            false => Err(SimError::World("the description gives no link a mass".into())),
        }
    }

    fn merge(&mut self, link: &RigidLink, (index, rotation, at): (usize, Mat3, Vec3)) {
        let body = &mut self.bodies[index];
        let com = at + rotation * Vec3::from(link.com_m);
        let inertia = rotation * matrix(&link.inertia_kg_m2) * rotation.transpose();
        let whole = SpatialInertia::new(body.mass, body.com, body.inertia)
            .plus(SpatialInertia::new(link.mass_kg, com, inertia));
        if whole.mass > 0.0 {
            body.mass = whole.mass;
            body.com = whole.first / whole.mass;
            let shifted = SpatialInertia::new(whole.mass, body.com, Mat3::zeros()).second;
            body.inertia = whole.second - shifted;
        }
        self.points.extend(link.touch.iter().map(|point| BodyPoint {
            body: index,
            at: at + rotation * Vec3::from(point.at_m),
            radius: point.radius_m,
            foot: point.foot,
        }));
    }

    /// The degree of freedom of a body's joint.
    pub fn dof(body: usize) -> usize {
        ROOT_DOFS + body - 1
    }

    pub fn dofs(&self) -> usize {
        ROOT_DOFS + self.bodies.len() - 1
    }

    /// For each degree of freedom the one before it on the way to the root.
    pub fn dof_parents(&self) -> Vec<Option<usize>> {
        let root = (0..ROOT_DOFS).map(|dof| dof.checked_sub(1));
        let joints = self.bodies[1..].iter().map(|body| match body.parent {
            0 => Some(ROOT_DOFS - 1),
            parent => Some(Self::dof(parent)),
        });
        root.chain(joints).collect()
    }
}

impl Body {
    fn still() -> Self {
        Self {
            parent: 0,
            rotation: Mat3::identity(),
            at: Vec3::zeros(),
            axis: Vec3::z(),
            slides: false,
            drive: LinkDrive { joint: usize::MAX, scale: 0.0, offset: 0.0 },
            mass: 0.0,
            com: Vec3::zeros(),
            inertia: Mat3::zeros(),
        }
    }
}

fn check(link: &RigidLink, known: usize) -> Result<(), SimError> {
    let numbers = link.inertia_kg_m2.iter().flatten().chain(&link.com_m).chain(&link.origin.at_m);
    let is_finite = numbers.chain([&link.mass_kg]).all(|number| number.is_finite());
    if !is_finite || link.mass_kg < 0.0 {
        let name = &link.name;
        return Err(SimError::World(format!("link `{name}`: mass or inertia is not usable")));
    }
    match link.parent {
        Some(parent) if parent >= known => {
            Err(SimError::World(format!("link `{}` comes before its parent", link.name)))
        }
        _ => Ok(()),
    }
}
