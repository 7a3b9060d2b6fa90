//! Why training cannot begin or go on.

use thiserror::Error;

use servodance_model::ModelError;
use servodance_model::motion::MotionError;

/// An error of training. Nothing is written when one is returned.
#[derive(Debug, Error)]
#[allow(missing_docs)] // the messages say it
pub enum TrainError {
    #[error(transparent)]
    Data(#[from] MotionError),
    /// The weights of the VQ-VAE cannot be used.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A setting is out of its range, or does not fit the data.
    #[error("{0}")]
    Settings(String),
    /// The checkpoint is no whole checkpoint of this program.
    #[error("not a whole checkpoint: {0}")]
    Checkpoint(String),
    #[error("checkpoint of another run: `{field}` is {found}, expected {expected}")]
    OtherRun { field: String, expected: String, found: String },
    /// The loss is no number any more: start again with a lower learning rate.
    #[error("the loss at step {step} is not finite; try a lower learning_rate")]
    Diverged { step: u64 },
}
