//! The values that cross servodance's crate borders: human motion, music
//! features, joint limits and joint states.
//!
//! Units: metres, radians, seconds, amperes. World frame of human motion: y up,
//! right-handed; the dancer faces +z at the start. Robot frames follow ROS
//! (x forward, y left, z up) and belong to the `retarget` crate.
//!
//! Values only: no input, no output, no algorithm. `audio` makes [`MusicFrame`]s,
//! `model` turns them into [`MotionFrame`]s, `retarget` turns those into joint
//! positions inside [`JointLimits`], and `drivers` report [`JointState`]s and the
//! [`ImuState`] of a motion sensor. [`RigidLink`]s are what physics knows of a robot.
//!
//! ```
//! use servodance_types::{BodyJoint, FRAME_RATE_HZ, JointLimits, MotionFrame};
//!
//! let mut frame = MotionFrame { time_s: 3.0 / FRAME_RATE_HZ, ..MotionFrame::default() };
//! frame.positions[BodyJoint::Head as usize] = [0.0, 1.6, 0.0];
//! assert_eq!(frame.position(BodyJoint::Head)[1], 1.6);
//! assert_eq!(BodyJoint::LeftWrist.mirrored(), BodyJoint::RightWrist);
//!
//! let knee = JointLimits {
//!     lower_rad: 0.0,
//!     upper_rad: 2.4,
//!     velocity_rad_s: 5.0,
//!     acceleration_rad_s2: 60.0,
//! };
//! assert_eq!(knee.checked()?.clamp_rad(3.0), 2.4);
//! # Ok::<(), String>(())
//! ```

mod body;
mod held_back;
mod joint;
mod motion;
mod music;
mod named;
mod rigid_link;

pub use body::{BodyJoint, JOINT_COUNT};
pub use held_back::HeldBack;
pub use joint::{ImuState, JointLimits, JointState};
pub use motion::{Contacts, MotionFrame, Point3, Posture};
pub use music::{Beat, BeatLock, MUSIC_DIM, MusicFrame, SPECTRAL_DIM};
pub use rigid_link::{LinkDrive, LinkMotion, Placement, RigidLink, TouchPoint};

/// Rate of music features, motion tokens and human motion, frames a second.
pub const FRAME_RATE_HZ: f64 = 20.0;
