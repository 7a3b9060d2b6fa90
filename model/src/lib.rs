//! MAGMA: music features to motion tokens to 22-joint motion.
//!
//! Start at [`Generator`]: load the weights, start a dance, give it a music
//! frame and take a motion frame, 20 times a second. [`Codec`] turns motion into
//! tokens and back.

pub mod conditioning;
pub mod config;
pub mod engine;
mod error;
mod generator;
pub mod motion;
pub mod motionseq;
mod sampling;
#[cfg(test)]
mod tests;
pub mod vqvae;
pub mod weights;

pub use conditioning::NO_STYLE;
pub use engine::{EngineKind, EngineOptions};
pub use error::ModelError;
pub use generator::{AtEnd, Dance, Generator, GeneratorOptions, Likelihood};
pub use vqvae::Codec;
pub use weights::Dtype;

/// The weights file that is part of this library.
pub fn built_in_weights() -> &'static [u8] {
    weights::BUILT_IN
}
