//! Human motion as numbers: clips of 22 joint positions, one skeleton for
//! all, the 137 numbers a frame that the networks see, and a choreographer.
//!
//! Units: metres, seconds, radians; y up. Nothing here knows of music audio;
//! beats come in as times in seconds.

pub mod aist;
pub mod asf;
pub mod bvh;
pub mod bvh_write;
pub mod choreography;
pub mod clip;
pub mod corpus;
pub mod humanml;
pub mod import;
pub mod index;
pub mod named_skeleton;
mod numpy;
mod pickle;
pub mod representation;
mod rotation;
pub mod skeleton;
pub mod smpl;
pub mod soundness;
pub mod splits;
pub mod tempo;
pub(crate) mod vec3;

pub use clip::{Clip, MotionError};
pub use representation::{POSE_DIM, PoseVector, Recovery, decode, encode};

use servodance_types::{JOINT_COUNT, Point3};

/// The positions of all joints in one frame, metres.
pub type Pose = [Point3; JOINT_COUNT];
