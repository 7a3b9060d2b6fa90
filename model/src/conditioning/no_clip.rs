//! In place of `clip.rs` in a build without candle: loading says so, and nothing else can
//! be called.

use std::convert::Infallible;
use std::path::Path;

use crate::error::ModelError;

/// CLIP's text encoder with its tokenizer.
#[derive(Debug)]
pub struct ClipText(Infallible);

impl ClipText {
    /// Refused: this build has no candle.
    pub fn load(_: &Path) -> Result<Self, ModelError> {
        Err(ModelError::NotBuiltIn { what: "CLIP" })
    }

    /// The vector of a text.
    pub fn embed(&self, _: &str) -> Result<Vec<f32>, ModelError> {
        match self.0 {}
    }
}
