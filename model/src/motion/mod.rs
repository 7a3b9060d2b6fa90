//! Human motion as numbers: clips of 22 joint positions, one skeleton for
//! all, and the 137 numbers a frame that the networks see.
//!
//! Units: metres, seconds, radians; y up. Nothing here knows of music audio;
//! beats come in as times in seconds.

pub mod alignment;
#[cfg(feature = "motion-files")]
pub mod bvh_write;
#[cfg(feature = "motion-files")]
pub mod clip;
pub mod error;
#[cfg(feature = "motion-files")]
pub mod numpy;
pub mod reconstruction;
pub mod representation;
pub mod rotation;
pub mod skeleton;
pub mod vec3;

pub use alignment::{Alignment, alignment, kinematic_beats_s, mean_joint_speed};
#[cfg(feature = "motion-files")]
pub use clip::Clip;
pub use error::MotionError;
pub use reconstruction::mpjpe_m;
pub use representation::{POSE_DIM, PoseVector, Recovery, decode, encode};

use servodance_types::{JOINT_COUNT, Point3};

/// The positions of all joints in one frame, metres.
pub type Pose = [Point3; JOINT_COUNT];
