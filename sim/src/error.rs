//! Why a simulated bus cannot start.

/// Why a simulated bus cannot start.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // each field stands in the message above it
pub enum SimError {
    /// An option that makes no sense.
    #[error("simulated bus: {key} is {actual}, must be {wanted}")]
    Option {
        key: &'static str,
        actual: String,
        wanted: &'static str,
    },
    /// A servo that makes no sense.
    #[error("simulated servo {joint} (id {id}): {reason}")]
    Servo {
        joint: String,
        id: u8,
        reason: String,
    },
    /// A line of a script of faults.
    #[error("fault \"{line}\": {reason}")]
    Script { line: String, reason: String },
    /// The system gave no pseudo-terminal or thread.
    #[error("simulated bus: {what}: {reason}")]
    System {
        what: &'static str,
        reason: std::io::Error,
    },
}
