//! In place of `encodec.rs` in a build without candle: loading says so, and nothing else can
//! be called.

use std::convert::Infallible;
use std::path::Path;

use super::music::Latent;
use crate::error::ModelError;

/// The encoder and the codebooks.
#[derive(Clone, Debug)]
pub struct Encodec(Infallible);

/// Sound in, latents out.
#[derive(Debug)]
pub struct EncodecStream(Infallible);

impl Encodec {
    /// Refused: this build has no candle.
    pub fn load(_: &Path) -> Result<Self, ModelError> {
        Err(ModelError::NotBuiltIn { what: "Encodec" })
    }

    /// A stream before which it was silent, and what is heard then.
    pub fn start_in_silence(&self) -> Result<(EncodecStream, Latent), ModelError> {
        match self.0 {}
    }
}

impl EncodecStream {
    /// Takes samples and hands out the frames that they complete.
    pub fn push(&mut self, _: &[f32], _: impl FnMut(&Latent)) -> Result<(), ModelError> {
        match self.0 {}
    }
}
