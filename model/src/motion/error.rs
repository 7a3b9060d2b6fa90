//! What can be wrong with a motion file.

use std::fmt::Display;
use std::path::{Path, PathBuf};

/// What can be wrong with a motion file. The message names the file.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the fields are what the message says")]
pub enum MotionError {
    /// The file cannot be read as an npz archive.
    #[error("{path}: cannot read motion: {reason}")]
    Read { path: PathBuf, reason: String },
    /// The file cannot be written.
    #[error("{path}: cannot write motion: {reason}")]
    Write { path: PathBuf, reason: String },
    /// The file reads, but holds no usable motion.
    #[error("{path}: {reason}")]
    Content { path: PathBuf, reason: String },
}

impl MotionError {
    /// The file cannot be opened or decoded; `error` is what the reader said.
    pub fn read(path: &Path, error: impl Display) -> Self {
        Self::Read { path: path.to_owned(), reason: error.to_string() }
    }

    /// The file cannot be written; `error` is what the writer said.
    pub fn write(path: &Path, error: impl Display) -> Self {
        Self::Write { path: path.to_owned(), reason: error.to_string() }
    }

    /// The file decodes, but its content cannot be used for this reason.
    pub fn content(path: &Path, reason: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), reason: reason.into() }
    }
}
