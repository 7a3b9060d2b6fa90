//! The two networks, inference only: the VQ encoders (motion to codes) and
//! decoder (codes to motion), and MotionSeq (codes and music to the next codes).
//!
//! Decoder and MotionSeq run a frame at a time with rotating key and value caches: memory and
//! time a frame stay constant however long the music lasts, and the output
//! equals one pass over everything (ALiBi, no absolute positions). The twin
//! in `model/reference/` trains the weights and writes the golden files.

mod attention;
mod config;
mod decoder;
mod encoder;
mod layers;
mod motionseq;
mod sampling;
#[cfg(test)]
mod tests;
mod weights;

pub use config::{Activation, ModelConfig, SeqConfig, VqConfig};
pub use decoder::{DecoderState, VqDecoder};
pub use encoder::VqEncoder;
pub use motionseq::{MotionSeq, SeqState};
pub use sampling::{Sampler, Sampling};
pub use weights::Weights;
