//! The error of what was stopped by Ctrl-C.

/// Stopped by Ctrl-C, after torque was turned off; the program ends with a status of its own.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("stopped; torque is off")]
pub struct Interrupted;
