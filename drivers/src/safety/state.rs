//! States of the safety layer, their changes, and what it changed.

/// A state of the safety layer: see the diagram of this module's parent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Torque is off and nothing is sent.
    Disarmed,
    /// Servos are being checked and set up.
    Arming,
    /// Targets are followed inside the limits.
    Running,
    /// No fresh targets: braked, holding position.
    Holding,
    /// Torque is being turned off.
    Stopping,
    /// Something failed; torque was turned off, or its servos named.
    Fault,
}

/// One change of state; a remark where `from` equals `to`.
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    /// Time on the caller's clock, seconds.
    pub time_s: f64,
    /// The state before the change.
    pub from: State,
    /// The state after the change.
    pub to: State,
    /// The cause, in words for the user.
    pub cause: String,
}

/// How often the safety layer changed what was asked for.
/// Joints count one by one; the ramp after arming does not count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Interventions {
    /// Target sets refused whole: not finite, or of the wrong length.
    pub nan: u64,
    /// Targets beyond a position limit.
    pub position: u64,
    /// Targets beyond the velocity limit.
    pub velocity: u64,
    /// Targets beyond the acceleration limit.
    pub acceleration: u64,
    /// Ticks that braked because no fresh targets came.
    pub stale: u64,
    /// Ticks that came too early and did nothing.
    pub early: u64,
    /// Targets made smaller for a servo close to its own limits.
    pub derated: u64,
}
