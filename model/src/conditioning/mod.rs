//! What the dance is conditioned on beside the built-in features: Encodec
//! latents of the music, a style in words through CLIP.
//!
//! Both read public checkpoints that a user brings; docs/conditioning.md says
//! which and where. [`MusicKind`] is what weights say they were trained to hear.

pub mod checkpoint;
mod clip;
mod encodec;
#[cfg(test)]
pub(crate) mod golden;
mod music;
mod seanet;
mod style;

pub use clip::{CLIP_DIM, ClipText};
pub use encodec::{ENCODEC_RATE_HZ, Encodec, EncodecStream, LATENT_DIM, Latent};
pub use crate::engine::candle::{TensorLinear, TensorNorm};
pub use music::{HeardFrame, MusicKind};
pub use style::NO_STYLE;

pub(crate) use style::{StyleConditioning, style_index};
