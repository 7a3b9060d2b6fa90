//! In place of `codec.rs` in a build without candle: loading says so, and nothing else can
//! be called.

use std::convert::Infallible;
use std::path::Path;

use crate::error::ModelError;
use crate::motion::Clip;

const NOT_BUILT_IN: ModelError = ModelError::NotBuiltIn { what: "the encoder of motion" };

/// Encoders, codebooks and decoder of a weights file.
#[derive(Clone, Debug)]
pub struct Codec(Infallible);

impl Codec {
    /// Refused: this build has no candle.
    pub fn built_in() -> Result<Self, ModelError> {
        Err(NOT_BUILT_IN)
    }

    /// Refused: this build has no candle.
    pub fn load(_: &Path) -> Result<Self, ModelError> {
        Err(NOT_BUILT_IN)
    }

    /// One code per body part for each frame but the last.
    pub fn encode(&self, _: &Clip) -> Result<Vec<Vec<usize>>, ModelError> {
        match self.0 {}
    }

    /// The same with the last frame as well.
    pub fn encode_all(&self, _: &Clip) -> Result<Vec<Vec<usize>>, ModelError> {
        match self.0 {}
    }

    /// The motion of the codes.
    pub fn decode(&self, _: &str, _: &[Vec<usize>]) -> Result<Clip, ModelError> {
        match self.0 {}
    }
}
