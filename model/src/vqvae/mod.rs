//! The VQ-VAE: motion to one code per body part and frame, and codes to motion.
//!
//! [`VqEncoder`] takes recorded motion, [`VqDecoder`] a stream of codes a frame at
//! a time; [`Codec`] is both, from clips to codes and back. The look-up of a code
//! and the search for the nearest one are in `codebook`.

mod candle;
mod codebook;
mod codec;
mod decoder;
mod encoder;
mod own;

pub use codec::Codec;
pub use decoder::{DecoderState, VqDecoder};
pub use encoder::VqEncoder;

#[cfg(test)]
pub(crate) use candle::CandleDecoder;
