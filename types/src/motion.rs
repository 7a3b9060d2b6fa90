//! Human motion: 22 joint positions, 20 times a second.

use crate::{BodyJoint, JOINT_COUNT};

/// A point or vector in metres: x, y (up), z.
pub type Point3 = [f32; 3];

/// Which feet stand on the floor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Contacts {
    /// The left ankle or toe is in contact.
    pub left: bool,
    /// The right ankle or toe is in contact.
    pub right: bool,
}

/// One frame of human motion in the world: y up, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionFrame {
    /// Presentation time in seconds since the music began.
    pub time_s: f64,
    /// Joint positions in metres, indexed by [`BodyJoint`].
    pub positions: [Point3; JOINT_COUNT],
    /// Which feet are in contact with the floor.
    pub contacts: Contacts,
}

impl MotionFrame {
    /// Position of one joint in the world, metres.
    pub fn position(&self, joint: BodyJoint) -> Point3 {
        self.positions[joint as usize]
    }

    /// Whether every number of the frame is finite.
    pub fn is_finite(&self) -> bool {
        self.time_s.is_finite() && self.positions.iter().flatten().all(|v| v.is_finite())
    }
}

/// The dancer's baseline posture: slow averages of the last seconds, against
/// which movement is measured. A receiver that joins late gets the averages with
/// the motion and need not wait to learn them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Posture {
    /// Facing direction, radians around y from z towards x.
    pub heading_rad: f32,
    /// Lean of the head against the chest: forward, to the left, radians.
    pub nod_rad: [f32; 2],
    /// Hips relative to the supporting foot: forward, to the left, in leg lengths.
    pub sway: [f32; 2],
    /// Left and right toes relative to the hips: forward, to the left, in leg lengths.
    pub feet: [[f32; 2]; 2],
    /// Height of the floor in the world, metres.
    pub floor_m: f32,
}
