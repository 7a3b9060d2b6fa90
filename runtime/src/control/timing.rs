//! What the control loop must know of time and music before it starts.

use super::idle::IdleStyle;
use crate::process::speed::Speed;

/// From torque on to the music: the robot goes to its first pose, seconds.
pub const LEAD_IN_S: f64 = 4.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionArrival {
    /// Ahead of the music, which is a recording.
    Ahead,
    /// After the music, which comes in as it is played.
    Live,
    /// A recording, danced to as if it came in live.
    AsLive,
    /// From the leader of a stage, with the time to show it.
    Led,
}

/// Options of one run of the control loop.
#[derive(Clone, Copy, Debug)]
pub struct LoopOptions {
    pub speed: Speed,
    pub arrival: MotionArrival,
    /// Whether the motion is steered onto the beat.
    pub compensation: bool,
    pub idle: IdleStyle,
}
