//! Why a simulated bus cannot start.

/// Why a simulated bus cannot start.
#[derive(Debug, thiserror::Error)]
pub enum SimError {
    /// An option that makes no sense.
    #[error("simulated bus: {key} is {actual}, must be {wanted}")]
    Option {
        /// Which option.
        key: &'static str,
        /// Its value.
        actual: String,
        /// What it may be.
        wanted: &'static str,
    },
    /// A servo that makes no sense.
    #[error("simulated servo {joint} (id {id}): {reason}")]
    Servo {
        /// The joint's name.
        joint: String,
        /// Its id.
        id: u8,
        /// What is wrong.
        reason: String,
    },
    /// A line of a script of faults.
    #[error("fault \"{line}\": {reason}")]
    Script {
        /// The line.
        line: String,
        /// What is wrong.
        reason: String,
    },
    /// The system gave no pseudo-terminal or thread.
    #[error("simulated bus: {what}: {reason}")]
    System {
        /// What was asked for.
        what: &'static str,
        /// What the system said.
        reason: std::io::Error,
    },
}
