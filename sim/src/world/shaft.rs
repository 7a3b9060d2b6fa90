//! What passes between a servo's shaft and the joint that it turns, in the joint's sense.

use super::JointDrive;

/// How the shaft of a servo moves by now.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ShaftState {
    pub position_rad: f64,
    pub velocity_rad_s: f64,
    /// Something from outside moves the robot: its true motion is nobody's fault.
    pub is_pushed: bool,
}

/// What a servo does to its joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ShaftDrive {
    /// `None` without torque.
    pub drive: Option<JointDrive>,
    /// Where a hand has put the joint since the last time.
    pub put_at_rad: Option<f64>,
}
