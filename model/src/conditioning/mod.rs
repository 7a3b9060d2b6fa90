//! What the dance is conditioned on beside the built-in features: Encodec
//! latents of the music, a style in words through CLIP.
//!
//! Both read public checkpoints that a user brings; docs/conditioning.md says
//! which and where. [`MusicKind`] is what weights say they were trained to hear.
//! How a style scales the layers is in `style`.

pub mod checkpoint;
mod clip;
mod encodec;
#[cfg(test)]
pub(crate) mod golden;
mod music;
mod seanet;
mod style;

pub use crate::config::{LATENT_DIM, MusicKind};
pub use crate::engine::candle::{TensorLinear, TensorNorm};
pub use clip::{CLIP_DIM, ClipText};
pub use encodec::{ENCODEC_RATE_HZ, Encodec, EncodecStream, Latent};
pub use music::HeardFrame;
pub use style::NO_STYLE;

pub(crate) use style::{StyleConditioning, style_index};
