//! Why no training file was built.

use servodance_model::motion::MotionError;

/// Why no training file was built.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum DatasetError {
    /// A motion file or the index is unusable, or the result cannot be written.
    #[error(transparent)]
    Motion(#[from] MotionError),
    #[error("cannot render music for {clip}: {reason}")]
    Music { clip: String, reason: String },
}
