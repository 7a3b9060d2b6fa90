//! What gave way, and what was refused: figures for the report.

use serde::Serialize;

/// Counters since the start; all of them are zero in an easy run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct RetargetCounts {
    /// Calls of `next`.
    pub cycles: u64,
    /// Frames with a number that is not finite or absurd; left out.
    pub unusable_frames: u64,
    /// Frames for a time that was there already, or far from all others; left out.
    pub late_frames: u64,
    /// Missing frames that were bridged by a straight line.
    pub bridged_frames: u64,
    /// Jumps of a body point that no dancer can make; approached smoothly.
    pub teleports: u64,
    /// Holes too long to bridge; the motion started anew after them.
    pub restarts: u64,
    /// Cycles later than the newest frame; the last pose was held.
    pub starved_cycles: u64,
    /// Cycles in which a limit held at least one joint behind its target.
    pub limited_cycles: u64,
    /// Cycles with a planted foot farther than 2 mm from its place.
    pub feet_moved_cycles: u64,
    /// Steps of a stepping robot.
    pub steps: u64,
    /// Steps of the dancer that balance did not allow.
    pub refused_steps: u64,
    /// Cycles in which an arm was held back before it met the body.
    pub guarded_cycles: u64,
    /// Cycles in which an arm touched another part of the robot (capsules).
    pub collision_cycles: u64,
    /// Deepest overlap of two capsules, micrometres.
    pub deepest_collision_um: u64,
    /// Cycles with the centre of mass outside the support polygon.
    pub unbalanced_cycles: u64,
    /// Cycles with the zero-moment point outside of it.
    pub tipping_cycles: u64,
}
