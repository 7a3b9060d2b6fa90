//! Training of both networks: a tape with its own operations ([`servodance_model::engine`] only
//! goes forward), AdamW, codebooks that learn by moving averages, checkpoints
//! that continue to the bit.
//!
//! Start at [`Trainer`]: settings ([`SettingsFile`], filled up from a preset),
//! data ([`TrainingData`]), then step by step. The same numbers follow from the same
//! settings and data on the same machine, whatever the number of threads and
//! however often the run was stopped. Files, progress and pictures are the
//! caller's (`servodance train`). The twin in PyTorch, `model/reference/`, has
//! the same networks and losses, and checks these.

mod autodiff;
mod checkpoint;
mod crops;
mod curve_tally;
mod data;
mod error;
mod layers;
mod motionseq;
mod network_training;
mod optimizer;
mod settings;
mod tensors;
#[cfg(test)]
mod tests;
mod trainer;
mod vqvae;

pub use data::TrainingData;
pub use error::TrainError;
pub use network_training::NamedValues;
pub use settings::{
    ClipWeights, ModelChanges, Preset, QuantiseSettings, RunOverrides, RunSettings, SettingsFile,
    TokenSettings, TrainedNetwork, TrainingSettings,
};
pub use trainer::{CurveRow, StepReport, Trainer};
pub use vqvae::codebook::CodebookSettings;
pub use vqvae::loss::LossWeights;
pub use vqvae::vqvae_weights::VqVaeWeights;

/// Does something with so many threads; 0: as many as the machine has.
pub fn with_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(work),
        // No threads to be had: with those that are there.
        Err(_) => work(),
    }
}
