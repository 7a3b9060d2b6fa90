//! What the dance is conditioned on beside the built-in features: Encodec
//! latents of the music, a style in words through CLIP.
//!
//! Both read public checkpoints that a user brings; docs/conditioning.md says
//! which and where. [`MusicKind`] is what weights say they were trained to hear.
//! How a style scales the layers is in `style`.

#[cfg(feature = "candle")]
pub mod checkpoint;
#[cfg_attr(not(feature = "candle"), path = "no_clip.rs")]
mod clip;
#[cfg_attr(not(feature = "candle"), path = "no_encodec.rs")]
mod encodec;
#[cfg(all(test, feature = "candle"))]
pub(crate) mod golden;
mod music;
#[cfg(feature = "candle")]
mod seanet;
mod style;

pub use crate::config::{LATENT_DIM, MusicKind};
#[cfg(feature = "candle")]
pub use crate::engine::candle::{TensorLinear, TensorNorm};
pub use clip::ClipText;
pub use encodec::{Encodec, EncodecStream};
pub use music::{HeardFrame, Latent};
pub use style::NO_STYLE;

pub(crate) use style::{StyleConditioning, style_index};

/// Numbers of a text's vector by CLIP; weights that take it have this `style_dim`.
pub const CLIP_DIM: usize = 512;
/// Samples a second that Encodec's checkpoint is given.
pub const ENCODEC_RATE_HZ: u32 = 6_400;
