//! What can go wrong between page and dance: one line for a person to read.

use servodance_audio::AnalyzerError;
use servodance_model::ModelError;
use servodance_retarget::RetargetError;

/// Why a call did nothing. The dance that was there before, if any, still is.
#[derive(Debug, thiserror::Error)]
pub enum WebError {
    /// The page called in the wrong order.
    #[error("{0}")]
    Order(&'static str),
    /// The page asked for something in a form that is not understood.
    #[error("the page asked for something unknown: {0}")]
    Request(#[from] serde_json::Error),
    #[allow(missing_docs)] // the message says it
    #[error("unknown robot \"{found}\"; built in: {known}")]
    UnknownRobot { found: String, known: String },
    #[allow(missing_docs)] // the message says it
    #[error("robot {name}: {reason}")]
    RobotFile { name: &'static str, reason: String },
    /// See the error inside; so of the next two.
    #[error(transparent)]
    Sound(#[from] AnalyzerError),
    #[allow(missing_docs)]
    #[error(transparent)]
    Model(#[from] ModelError),
    #[allow(missing_docs)]
    #[error(transparent)]
    Retarget(#[from] RetargetError),
}
