//! MAGMA in candle: music features to motion tokens to 22-joint motion.
//!
//! Start at [`Generator`]: load the weights, start a dance, give it a music
//! frame and take a motion frame, 20 times a second. [`Codec`] turns motion into
//! tokens and back. [`net`] holds the two networks, [`motion`] what human motion is in numbers, [`metrics`] how a
//! dance is scored, [`conditioning`] what else it can follow, [`train`] learns the
//! weights of both networks; the twin in `model/reference/` checks it and trains
//! on a GPU.

mod codec;
pub mod conditioning;
pub mod error;
pub mod generator;
mod likelihood;
pub mod motion;
pub mod net;
pub mod tensor_file;

pub use codec::Codec;
pub use error::ModelError;
pub use generator::{AtEnd, Dance, Generator, GeneratorOptions};
pub use likelihood::Likelihood;

/// The weights file that is part of this library.
pub fn built_in_weights() -> &'static [u8] {
    generator::BUILT_IN
}
