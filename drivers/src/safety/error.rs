//! Why the safety layer stopped, or never began.

use super::state::State;
use crate::error::{BusError, ServoId};

/// Why the safety layer stopped, or never began.
#[allow(missing_docs)] // each field stands in its message
#[derive(Debug, thiserror::Error)]
pub enum SafetyError {
    #[error("safety: {key} is {actual}, must be positive and at most {highest}")]
    Config { key: &'static str, actual: f64, highest: f64 },
    #[error("{0}; torque is off")]
    Bus(BusError),
    #[error("{cause}; {}", torque.brief())]
    Unsafe { cause: String, torque: BusError },
    #[error(
        "{servo} is {error_deg:.1} degrees from its command for more than {after_s} s \
         (blocked, overloaded, rebooted, or held by its own watchdog while this program was kept from running?); torque is off"
    )]
    Following { servo: ServoId, error_deg: f64, after_s: f64 },
    #[error("{servo}: {what} is {actual:.1} {unit}, the limit is {limit:.1} {unit}; torque is off")]
    Condition { servo: ServoId, what: &'static str, actual: f64, limit: f64, unit: &'static str },
    /// The emergency stop was pressed; it must be cleared on purpose.
    #[error("emergency stop ({cause}): torque is off until it is cleared")]
    EStop { cause: String },
    #[error("cannot {call} in state {state:?}")]
    State { call: &'static str, state: State },
}
