//! What can be wrong with a motion file.

use std::path::PathBuf;

/// What can be wrong with a motion file. The message names the file.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the fields are what the message says")]
pub enum MotionError {
    /// The file cannot be read as an npz archive.
    #[error("{path}: cannot read motion: {reason}")]
    Read {
        path: PathBuf,
        reason: String,
    },
    /// The file reads, but holds no usable motion.
    #[error("{path}: {reason}")]
    Content {
        path: PathBuf,
        reason: String,
    },
}
