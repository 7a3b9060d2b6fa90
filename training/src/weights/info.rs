//! What a weights file holds.

use std::fmt;
use std::path::Path;

use serde::Serialize;
use servodance_model::weights::{ENCODERS, Weights};
use servodance_model::{Codec, Generator, ModelError};

/// What a weights file holds; serialised as the JSON of `weights info`.
#[derive(Clone, Debug, Serialize)]
pub struct WeightsInfo {
    file: String,
    preset: String,
    dtype: &'static str,
    bytes: usize,
    encoders: bool,
    styles: Vec<String>,
    provenance: String,
}

impl WeightsInfo {
    /// Loads everything, so that whatever is wrong is said.
    pub fn of(file: Option<&Path>, preset: Option<&str>) -> anyhow::Result<Self> {
        let (bytes, name) = read(file)?;
        let weights = Weights::open(&bytes, &name)?;
        if let Some(preset) = preset {
            weights.expect_preset(preset)?;
        }
        let generator = Generator::from_bytes(&bytes, &name)?;
        let encoders = match Codec::from_bytes(&bytes, &name) {
            Ok(_) => true,
            // A file made for dancing alone.
            Err(ModelError::MissingTensor { tensor, .. }) if tensor.starts_with(ENCODERS) => false,
            Err(error) => return Err(error.into()),
        };
        Ok(Self {
            file: name,
            preset: generator.config().preset.clone(),
            dtype: weights.dtype().name(),
            bytes: bytes.len(),
            encoders,
            styles: generator.styles().to_vec(),
            provenance: generator.provenance().to_owned(),
        })
    }
}

impl fmt::Display for WeightsInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size_mb = self.bytes as f64 / 1e6;
        let encoders = if self.encoders { "with" } else { "without" };
        writeln!(
            f,
            "{}: preset {}, {}, {size_mb:.1} MB, {encoders} encoders, every tensor sound",
            self.file, self.preset, self.dtype
        )?;
        writeln!(f, "styles: {}", self.styles.join(", "))?;
        write!(f, "provenance: {}", self.provenance)
    }
}

/// The bytes of a weights file and its name; the built-in weights without one.
pub(super) fn read(file: Option<&Path>) -> anyhow::Result<(Vec<u8>, String)> {
    Ok(match file {
        Some(path) => (Weights::read(path)?, path.display().to_string()),
        None => (servodance_model::built_in_weights().to_vec(), "built-in weights".to_owned()),
    })
}
