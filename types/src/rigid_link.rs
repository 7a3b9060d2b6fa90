//! A robot as rigid links on joints: what a physics engine needs of it.

/// A frame in another one: rotation as rows of a matrix, then translation, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Rows of the rotation matrix.
    pub rotation: [[f64; 3]; 3],
    /// Where the frame's origin is, metres.
    pub at_m: [f64; 3],
}

/// How a link moves against its parent. Axes are unit vectors in the joint's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)] // the names say it
pub enum LinkMotion {
    Fixed,
    Revolute([f64; 3]),
    Prismatic([f64; 3]),
}

/// The driven joint that a link's joint follows: `scale * position + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkDrive {
    /// Index in the order of the robot's driven joints.
    pub joint: usize,
    /// 1 but for links that follow another joint.
    pub scale: f64,
    /// Radians; metres where the joint slides.
    pub offset: f64,
}

/// A ball by which a link can touch the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TouchPoint {
    /// Its centre in the link's frame, metres.
    pub at_m: [f64; 3],
    /// 0 for a corner.
    pub radius_m: f64,
    /// The foot whose sole it belongs to: 0 left, 1 right.
    pub foot: Option<usize>,
}

/// One link of a robot's tree.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidLink {
    /// As the description names it.
    pub name: String,
    /// Index of the parent, which comes earlier; `None` for the root.
    pub parent: Option<usize>,
    /// The joint's frame in the parent's, at position zero.
    pub origin: Placement,
    /// How the joint moves.
    pub motion: LinkMotion,
    /// `None`: the joint stays where it is.
    pub drive: Option<LinkDrive>,
    /// Mass of the link, kilograms.
    pub mass_kg: f64,
    /// Centre of mass in the link's frame, metres.
    pub com_m: [f64; 3],
    /// Rows of the inertia about the centre of mass, axes of the link, kg m2.
    pub inertia_kg_m2: [[f64; 3]; 3],
    /// Where it can touch the floor.
    pub touch: Vec<TouchPoint>,
}
