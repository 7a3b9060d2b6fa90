//! The few values that cross servodance's crate borders.
//!
//! Units everywhere: metres, radians, seconds. World frame of human motion:
//! y up, right-handed, the dancer faces +z at the start. Robot frames follow
//! ROS (x forward, y left, z up) and belong to the `retarget` crate.
//!
//! This crate holds values only: no input, no output, no algorithm.

mod body;
mod clock;
mod joint;
mod motion;
mod music;

pub use body::{BodyJoint, JOINT_COUNT};
pub use clock::{Clock, ManualClock, WallClock};
pub use joint::{JointLimits, JointState};
pub use motion::{Contacts, MotionFrame, Point3, Posture};
pub use music::{Beat, BeatLock, MUSIC_DIM, MusicFrame, SPECTRAL_DIM};

/// Frames a second of music features, motion tokens and human motion.
pub const FRAME_RATE_HZ: f64 = 20.0;
