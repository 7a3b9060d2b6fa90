//! Training of both stages: a tape with its own operations ([`servodance_model::engine`] only
//! goes forward), AdamW, codebooks that learn by moving averages, checkpoints
//! that continue to the bit.
//!
//! Start at [`Trainer`]: settings ([`SettingsFile`], filled up from a preset),
//! data ([`Data`]), then step by step. The same numbers follow from the same
//! settings and data on the same machine, whatever the number of threads and
//! however often the run was stopped. Files, progress and pictures are the
//! caller's (`servodance train`). The twin in PyTorch, `model/reference/`, has
//! the same networks and losses, and checks these.

mod checkpoint;
mod codebook;
mod data;
mod error;
mod lanes;
mod layers;
mod motion_loss;
mod motionseq;
mod nll;
mod ops;
mod optimizer;
mod parameters;
mod product;
mod settings;
mod stage1;
mod stage2;
mod tape;
mod tensors;
#[cfg(test)]
mod tests;
mod tokens;
mod trainer;
mod vqvae;

pub use codebook::CodebookSettings;
pub use data::Data;
pub use error::TrainError;
pub use motion_loss::LossWeights;
pub use settings::{
    ClipWeights, ModelChanges, Preset, QuantiseSettings, Settings, SettingsFile, StageFile,
    StageKind, StageSettings, TokenSettings,
};
pub use stage2::StageOne;
pub use trainer::{CurveRow, Named, StepReport, Trainer};

/// Does something with so many threads; 0: as many as the machine has.
pub fn with_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(work),
        // No threads to be had: with those that are there.
        Err(_) => work(),
    }
}
