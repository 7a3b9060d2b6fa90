//! What the dance is conditioned on beside the built-in features: Encodec
//! latents of the music, a style in words through CLIP.
//!
//! Both read public checkpoints that a user brings; docs/conditioning.md says
//! which and where. [`MusicKind`] is what weights say they were trained to hear.
//! How a style scales the layers is in `style`.

#[cfg(feature = "candle")]
pub mod checkpoint;
#[cfg(feature = "candle")]
mod clip;
#[cfg(feature = "candle")]
mod encodec;
#[cfg(test)]
pub(crate) mod golden;
mod music;
#[cfg(feature = "candle")]
mod seanet;
mod style;

pub use crate::config::{LATENT_DIM, MusicKind};
#[cfg(feature = "candle")]
pub use crate::engine::candle::{TensorLinear, TensorNorm};
#[cfg(feature = "candle")]
pub use clip::{CLIP_DIM, ClipText};
#[cfg(feature = "candle")]
pub use encodec::{ENCODEC_RATE_HZ, Encodec, EncodecStream};
pub use music::{HeardFrame, Latent};
pub use style::NO_STYLE;

pub(crate) use style::{StyleConditioning, style_index};
