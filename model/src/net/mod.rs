//! The two networks, inference only: the VQ encoders (motion to codes) and
//! decoder (codes to motion), and MotionSeq (codes and music to the next codes).
//!
//! Decoder and MotionSeq run a frame at a time ([`stream`](VqDecoder), on an
//! [`Engine`] of their own) with rotating key and value caches: memory and time a
//! frame stay constant however long the music lasts, and the output equals one
//! pass over everything in candle ([`OneShotDecoder`], [`OneShotSeq`]). The twin
//! in `model/reference/` trains the weights and writes the golden files.

#[cfg(test)]
pub(crate) mod absolute_tests;
mod attention;
mod config;
mod convert;
mod decoder;
mod echo;
mod encoder;
mod engine;
mod layers;
mod motionseq;
mod presets;
mod random;
mod sampling;
mod stream;
#[cfg(test)]
mod tests;
mod weights;

pub use config::{Activation, ModelConfig, Positions, SeqConfig, VqConfig};
pub use convert::{convert, convert_file};
pub use decoder::OneShotDecoder;
pub use echo::Echo;
pub use encoder::VqEncoder;
pub use engine::{Dtype, Engine, EngineOptions, Pool, Team, default_threads};
pub use motionseq::OneShotSeq;
pub use presets::PRESETS;
pub use sampling::{Recent, Sampler, Sampling};
pub use stream::{DecoderState, MotionSeq, SeqState, VqDecoder};
pub use weights::Weights;

pub use encoder::part_channels;
pub use weights::FORMAT;
