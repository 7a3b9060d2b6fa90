//! What the dancer does: frames in, what the robot shall show out.

mod angles;
mod baseline_posture;
mod figure;
mod motion_buffer;
mod pose_target;
mod surrounding_posture;

pub(crate) use angles::{direction, mean_angle, soft_limit, turn, wrap, yaw_of};
pub use baseline_posture::PostureReader;
pub(crate) use baseline_posture::{
    BaselineEstimator, BaselinePosture, PostureSample, PostureTrack, chest_yaw, pelvis_yaw,
};
pub(crate) use figure::{
    ArmMount, MOST_BASE_TURN, antenna_figure, arm_figure, base_figure, plate_figure, trunk_figure,
};
pub use motion_buffer::BodyPoints;
pub(crate) use motion_buffer::{LOOKAHEAD_FRAMES, MotionBuffer, robot_axes, usable_points};
pub(crate) use pose_target::{HeadingReference, PoseReader, PoseTarget, mirrored};
pub use surrounding_posture::surrounding_postures;
