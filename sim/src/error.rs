//! Why a simulated bus cannot start.

#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // each field stands in the message above it
pub enum SimError {
    #[error("simulated bus: {key} is {actual}, must be {wanted}")]
    Option {
        key: &'static str,
        actual: String,
        wanted: &'static str,
    },
    #[error("simulated servo {joint} (id {id}): {reason}")]
    Servo {
        joint: String,
        id: u8,
        reason: String,
    },
    #[error("fault \"{line}\": {reason}")]
    Script { line: String, reason: String },
    #[error("simulated bus: {what}: {reason}")]
    System {
        what: &'static str,
        reason: std::io::Error,
    },
}
