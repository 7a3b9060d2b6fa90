//! What the safety layer is doing, and why it stopped.

use crate::error::{BusError, ServoId};

/// Where the safety layer is: see the diagram of this module's parent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Torque is off.
    Disarmed,
    /// Servos are being checked and set up.
    Arming,
    /// Targets are followed.
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
    /// When, on the caller's clock.
    pub time_s: f64,
    /// State before.
    pub from: State,
    /// State after.
    pub to: State,
    /// Why.
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
    /// Targets that were too fast.
    pub velocity: u64,
    /// Targets whose speed changed too fast.
    pub acceleration: u64,
    /// Ticks without fresh targets.
    pub stale: u64,
    /// Ticks that came too early and did nothing.
    pub early: u64,
    /// Targets made smaller for a servo close to its own limits.
    pub derated: u64,
}

/// Why the safety layer stopped, or never began.
#[derive(Debug, thiserror::Error)]
pub enum SafetyError {
    /// A value of [`SafetyConfig`](super::SafetyConfig) that makes no sense.
    #[error("safety: {key} is {actual}, must be positive and at most {highest}")]
    Config {
        /// Which value.
        key: &'static str,
        /// What it is.
        actual: f64,
        /// The most that it may be.
        highest: f64,
    },
    /// The bus failed, and every torque is verified off.
    #[error("{0}; torque is off")]
    Bus(#[source] BusError),
    /// The bus failed, and so did turning torque off.
    #[error("{cause}; {}", torque.brief())]
    Unsafe {
        /// What failed first.
        cause: String,
        /// Why torque may still be on, with the joints.
        torque: BusError,
    },
    /// A joint does not go where it is told.
    #[error(
        "{servo} is {error_deg:.1} degrees from its command for more than {after_s} s \
         (blocked, overloaded, rebooted, or held by its own watchdog while this program was kept from running?); torque is off"
    )]
    Following {
        /// Which servo.
        servo: ServoId,
        /// How far off, degrees.
        error_deg: f64,
        /// The allowed time.
        after_s: f64,
    },
    /// A servo is at a limit of its own.
    #[error("{servo}: {what} is {actual:.1} {unit}, the limit is {limit:.1} {unit}; torque is off")]
    Condition {
        /// Which servo.
        servo: ServoId,
        /// The quantity.
        what: &'static str,
        /// Its value.
        actual: f64,
        /// Where the safety layer stops.
        limit: f64,
        /// The unit of both.
        unit: &'static str,
    },
    /// The emergency stop was pressed; it must be cleared on purpose.
    #[error("emergency stop ({cause}): torque is off until it is cleared")]
    EStop {
        /// Who pressed it.
        cause: String,
    },
    /// A call that the state does not allow.
    #[error("cannot {call} in state {state:?}")]
    State {
        /// What was called.
        call: &'static str,
        /// The state.
        state: State,
    },
}
