//! Why the safety layer stopped, or never began.

use super::state::State;
use crate::error::{BusError, ServoId};

/// Why the safety layer stopped, or never began.
#[derive(Debug, thiserror::Error)]
pub enum SafetyError {
    /// A value of [`SafetyConfig`](super::SafetyConfig) that makes no sense.
    #[error("safety: {key} is {actual}, must be positive and at most {highest}")]
    Config {
        /// The key in the `[safety]` table.
        key: &'static str,
        /// Its value, in the unit of the key.
        actual: f64,
        /// The highest value that is allowed.
        highest: f64,
    },
    /// The bus failed, and every torque is verified off.
    #[error("{0}; torque is off")]
    Bus(#[source] BusError),
    /// The bus failed, and so did turning torque off.
    #[error("{cause}; {}", torque.brief())]
    Unsafe {
        /// The error that came first, in words.
        cause: String,
        /// Why torque may still be on, with the joints.
        torque: BusError,
    },
    #[error(
        "{servo} is {error_deg:.1} degrees from its command for more than {after_s} s \
         (blocked, overloaded, rebooted, or held by its own watchdog while this program was kept from running?); torque is off"
    )]
    /// A joint stays away from its command.
    Following {
        /// The servo that does not follow.
        servo: ServoId,
        /// Distance from the command, degrees.
        error_deg: f64,
        /// Time that is allowed for it, seconds.
        after_s: f64,
    },
    /// A servo is at a limit of its own.
    #[error("{servo}: {what} is {actual:.1} {unit}, the limit is {limit:.1} {unit}; torque is off")]
    Condition {
        /// The servo at its limit.
        servo: ServoId,
        /// The quantity, e.g. `temperature`.
        what: &'static str,
        /// Its value, in `unit`.
        actual: f64,
        /// Value at which the layer stops, in `unit`.
        limit: f64,
        /// The unit of `actual` and `limit`.
        unit: &'static str,
    },
    /// The emergency stop was pressed; it must be cleared on purpose.
    #[error("emergency stop ({cause}): torque is off until it is cleared")]
    EStop {
        /// What pressed it first, in words.
        cause: String,
    },
    /// A call that the state does not allow.
    #[error("cannot {call} in state {state:?}")]
    State {
        /// The call, as a verb.
        call: &'static str,
        /// The state that refused it.
        state: State,
    },
}
