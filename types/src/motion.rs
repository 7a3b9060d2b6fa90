//! Human motion: 22 points, 20 times a second.

use crate::{BodyJoint, JOINT_COUNT};

/// A point or vector in metres: x, y (up), z.
pub type Point3 = [f32; 3];

/// Which parts of the feet stand on the floor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Contacts {
    /// The left ankle or toe is in contact.
    pub left: bool,
    /// The right ankle or toe is in contact.
    pub right: bool,
}

/// One frame of human motion in the world: y up, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionFrame {
    /// Presentation time in seconds since the music began.
    pub time_s: f64,
    /// Joint positions, indexed by [`BodyJoint`].
    pub positions: [Point3; JOINT_COUNT],
    /// Feet on the floor.
    pub contacts: Contacts,
}

impl MotionFrame {
    /// Position of one joint.
    pub fn position(&self, joint: BodyJoint) -> Point3 {
        self.positions[joint as usize]
    }

    /// Whether every number of the frame is finite.
    pub fn is_finite(&self) -> bool {
        self.time_s.is_finite() && self.positions.iter().flatten().all(|v| v.is_finite())
    }
}

/// How the dancer usually stood in the last seconds: slow averages, against
/// which movement is seen. Whoever sends them along spares others the seconds
/// that it takes to learn them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Posture {
    /// Where it faces, radians around y from z towards x.
    pub heading_rad: f32,
    /// How the head leans against the chest: forward, to the left, radians.
    pub nod_rad: [f32; 2],
    /// Hips before the foot that carries: forward, to the left, in leg lengths.
    pub sway: [f32; 2],
    /// Left and right toes before the hips: forward, to the left, in leg lengths.
    pub feet: [[f32; 2]; 2],
    /// Height of the floor, metres.
    pub floor_m: f32,
}
