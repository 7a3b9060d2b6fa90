//! The weights file: safetensors with the configuration in its metadata.
//!
//! Everything is checked when it is taken out: name, shape, number format,
//! and that each number is finite. f16 and f32 are read; the networks run in
//! f32, for which the matrix-vector product is at the speed of memory.

use std::path::Path;

use candle_core::{Device, Tensor};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use super::config::ModelConfig;
use crate::error::ModelError;

/// What the metadata must say for this layout.
const FORMAT: &str = "servodance-model-1";

/// An open weights file.
pub struct Weights<'a> {
    source: String,
    tensors: SafeTensors<'a>,
    config: ModelConfig,
    default_style: usize,
    provenance: String,
}

impl<'a> Weights<'a> {
    /// Reads a file's bytes whole.
    pub fn read(path: &Path) -> Result<Vec<u8>, ModelError> {
        std::fs::read(path).map_err(|e| ModelError::File {
            source_name: path.display().to_string(),
            reason: e.to_string(),
        })
    }

    /// Opens the bytes of a file; `source` names it in errors.
    pub fn open(bytes: &'a [u8], source: &str) -> Result<Self, ModelError> {
        let file = |reason: String| ModelError::File {
            source_name: source.to_owned(),
            reason,
        };
        let config = |reason: String| ModelError::Config {
            source_name: source.to_owned(),
            reason,
        };
        let tensors = SafeTensors::deserialize(bytes)
            .map_err(|e| file(format!("not a whole safetensors file: {e}")))?;
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| file(e.to_string()))?;
        let metadata = header.metadata().clone().unwrap_or_default();
        let format = metadata.get("format").map_or("none", String::as_str);
        if format != FORMAT {
            return Err(config(format!("format is `{format}`, expected `{FORMAT}`")));
        }
        let text = metadata
            .get("config")
            .ok_or_else(|| config("`config` is missing from the metadata".into()))?;
        let parsed = ModelConfig::from_json(text).map_err(config)?;
        let default = metadata.get("default_style").map_or("", String::as_str);
        let styles = &parsed.seq.styles;
        let default_style = styles.iter().position(|s| s == default).ok_or_else(|| {
            config(format!(
                "default_style is `{default}`, expected one of: {}",
                styles.join(", ")
            ))
        })?;
        Ok(Self {
            source: source.to_owned(),
            tensors,
            config: parsed,
            default_style,
            provenance: metadata.get("provenance").cloned().unwrap_or_default(),
        })
    }

    /// The sizes that the file says it has.
    pub fn config(&self) -> &ModelConfig {
        &self.config
    }

    /// The style danced when none is asked for, an index into the styles.
    pub fn default_style(&self) -> usize {
        self.default_style
    }

    /// Where the weights came from: data, date, figures (JSON).
    pub fn provenance(&self) -> &str {
        &self.provenance
    }

    /// An error about the configuration of this file.
    pub(crate) fn config_error(&self, reason: String) -> ModelError {
        ModelError::Config {
            source_name: self.source.clone(),
            reason,
        }
    }

    /// A tensor of exactly this shape, as f32 on the CPU.
    pub fn tensor(&self, name: &str, shape: &[usize]) -> Result<Tensor, ModelError> {
        let values = self.floats(name, shape)?;
        Ok(Tensor::from_vec(values, shape, &Device::Cpu)?)
    }

    /// The numbers of a tensor of exactly this shape.
    pub fn floats(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, ModelError> {
        let view = self.view(name, shape)?;
        let values: Vec<f32> = match view.dtype() {
            Dtype::F32 => chunks(view.data()).map(f32::from_le_bytes).collect(),
            Dtype::F16 => chunks(view.data())
                .map(|b| half::f16::from_le_bytes(b).to_f32())
                .collect(),
            other => return Err(self.wrong_type(name, "F16 or F32", other)),
        };
        if let Some(index) = values.iter().position(|v| !v.is_finite()) {
            return Err(ModelError::NotFinite {
                source_name: self.source.clone(),
                tensor: name.to_owned(),
                index,
            });
        }
        Ok(values)
    }

    /// The rows of a table of integers, each below `limit`.
    pub fn integer_rows(
        &self,
        name: &str,
        columns: usize,
        limit: usize,
    ) -> Result<Vec<Vec<usize>>, ModelError> {
        let rows = match self.tensors.tensor(name) {
            Ok(view) => view.shape().first().copied().unwrap_or(0),
            Err(_) => 0,
        };
        let view = self.view(name, &[rows, columns])?;
        if view.dtype() != Dtype::I32 {
            return Err(self.wrong_type(name, "I32", view.dtype()));
        }
        let values: Vec<usize> = chunks(view.data())
            .map(|b| i32::from_le_bytes(b) as usize)
            .collect();
        if let Some(bad) = values.iter().find(|v| **v >= limit) {
            return Err(self.config_error(format!(
                "tensor `{name}` holds {bad}, expected numbers below {limit}"
            )));
        }
        Ok(values.chunks(columns).map(<[usize]>::to_vec).collect())
    }

    fn view(&self, name: &str, shape: &[usize]) -> Result<TensorView<'_>, ModelError> {
        let view = self
            .tensors
            .tensor(name)
            .map_err(|_| ModelError::MissingTensor {
                source_name: self.source.clone(),
                tensor: name.to_owned(),
                expected: shape.to_vec(),
            })?;
        if view.shape() != shape {
            return Err(ModelError::Shape {
                source_name: self.source.clone(),
                tensor: name.to_owned(),
                expected: shape.to_vec(),
                found: view.shape().to_vec(),
            });
        }
        Ok(view)
    }

    fn wrong_type(&self, name: &str, expected: &'static str, found: Dtype) -> ModelError {
        ModelError::Type {
            source_name: self.source.clone(),
            tensor: name.to_owned(),
            expected,
            found: format!("{found:?}"),
        }
    }
}

/// The bytes in groups of N; safetensors has checked that none are left over.
fn chunks<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u8; N]> + '_ {
    bytes.as_chunks::<N>().0.iter().copied()
}
