//! What the dancer does: frames in, what the robot shall show out.

pub(crate) mod angles;
pub(crate) mod baseline_posture;
pub(crate) mod motion_buffer;
pub(crate) mod pose_target;
