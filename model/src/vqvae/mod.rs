//! The VQ-VAE: motion to one code per body part and frame, and codes to motion.
//!
//! [`VqEncoder`] takes recorded motion, [`VqDecoder`] a stream of codes a frame at
//! a time; [`Codec`] is both, from clips to codes and back. The look-up of a code is in
//! `codebook`, the search for the nearest one in `nearest_code`.

#[cfg_attr(not(feature = "candle"), path = "no_candle.rs")]
mod candle;
mod codebook;
#[cfg(feature = "motion-files")]
#[cfg_attr(not(feature = "candle"), path = "no_codec.rs")]
mod codec;
mod decoder;
#[cfg(feature = "candle")]
mod encoder;
#[cfg(feature = "candle")]
mod nearest_code;
mod own;

#[cfg(feature = "motion-files")]
pub use codec::Codec;
pub use decoder::{DecoderState, VqDecoder};
#[cfg(feature = "candle")]
pub use encoder::VqEncoder;

#[cfg(all(test, feature = "candle"))]
pub(crate) use candle::CandleDecoder;
