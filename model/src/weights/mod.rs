//! The weights file: safetensors with the configuration in its metadata.
//!
//! Everything is checked when it is taken out: name, shape, number format,
//! and that each number is finite. A matrix `NAME` [rows, columns] is F32 or
//! F16; or, quantised in blocks of 32 columns, I8 [rows, columns] (`q8_0`), U8
//! [rows, 96 for each 128 columns begun] (`q6`) or U8 [rows, columns / 2]
//! (`q4_0`), with `NAME.scale`, F16 [rows, columns / 32], beside it.

use std::path::Path;

use safetensors::tensor::{Dtype as StoredAs, SafeTensors, TensorView};

use crate::config::ModelConfig;
use crate::error::ModelError;

mod convert;
mod dtype;
mod join;
mod packed;
pub(crate) mod random;
mod slab;
pub mod tensor_file;

pub use convert::{ENCODERS, Keep, convert, convert_file};
pub use dtype::Dtype;
pub(crate) use dtype::{BLOCK, CHUNK, CHUNK_WORDS, q6_quant};
#[cfg(test)]
pub(crate) use dtype::{q4_block, q4_values, q8_block};
pub use join::with_stage_one;
pub(crate) use packed::{PackedMatrix, PackedNumbers, gather, padded, scales_width};

use packed::q6_bytes;

/// The trained weights of a dance in `q8_0`, part of the program so that it runs by itself.
/// `weights/live.safetensors` is what was trained; a test makes this file of it.
pub(crate) const BUILT_IN: &[u8] = include_bytes!("../../weights/dance.safetensors");

/// What the metadata must say for this layout.
pub const FORMAT: &str = "servodance-model-1";

/// An open weights file, or random weights.
pub struct Weights<'a> {
    source: String,
    /// None: every tensor that is asked for is there, and random.
    tensors: Option<SafeTensors<'a>>,
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
        let file = |reason: String| ModelError::File { source_name: source.to_owned(), reason };
        let config = |reason: String| ModelError::Config { source_name: source.to_owned(), reason };
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
            config(format!("default_style is `{default}`, expected one of: {}", styles.join(", ")))
        })?;
        Ok(Self {
            source: source.to_owned(),
            tensors: Some(tensors),
            config: parsed,
            default_style,
            provenance: metadata.get("provenance").cloned().unwrap_or_default(),
        })
    }

    /// Random weights of any sizes, always the same: to measure time with.
    pub fn random(config: ModelConfig) -> Weights<'static> {
        Weights {
            source: "random weights".to_owned(),
            tensors: None,
            config,
            default_style: 0,
            provenance: String::new(),
        }
    }

    /// Refuses a file of another preset.
    pub fn expect_preset(&self, preset: &str) -> Result<(), ModelError> {
        let found = &self.config.preset;
        if found == preset {
            return Ok(());
        }
        Err(self.config_error(format!("preset is `{found}`, expected `{preset}`")))
    }

    /// The narrowest number format that a matrix of the file has.
    pub fn dtype(&self) -> Dtype {
        let Some(file) = &self.tensors else {
            return Dtype::F32;
        };
        let stored = file.iter().map(|(name, view)| match view.dtype() {
            StoredAs::U8 => self.format_of_bytes(name, &view),
            StoredAs::I8 => Dtype::Q8_0,
            StoredAs::F16 => Dtype::F16,
            _ => Dtype::F32,
        });
        let narrowness = |dtype: &Dtype| Dtype::ALL.iter().position(|d| d == dtype);
        stored.max_by_key(narrowness).unwrap_or(Dtype::F32)
    }

    /// Columns of a quantised matrix, as its scales tell.
    pub(crate) fn quantised_columns(&self, name: &str) -> Option<usize> {
        let scales = self.tensors.as_ref()?.tensor(&format!("{name}.scale")).ok()?;
        Some(scales.shape().last()?.saturating_mul(BLOCK))
    }

    /// The format of a matrix that is stored as bytes.
    fn format_of_bytes(&self, name: &str, view: &TensorView) -> Dtype {
        let wanted = self.quantised_columns(name).map(q6_bytes);
        match wanted.is_some() && view.shape().last() == wanted.as_ref() {
            true => Dtype::Q6,
            false => Dtype::Q4_0,
        }
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
        ModelError::Config { source_name: self.source.clone(), reason }
    }

    /// The numbers of a tensor of exactly this shape.
    pub fn floats(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, ModelError> {
        let Some(stored) = self.stored(name, shape)? else {
            return Ok(random::tensor(name, shape));
        };
        let values = stored.floats();
        self.all_finite(name, &values)?;
        Ok(values)
    }

    /// A matrix of exactly this shape, packed; as it is in the file where that
    /// has the same format.
    pub(crate) fn matrix(
        &self,
        name: &str,
        rows: usize,
        width: usize,
        dtype: Dtype,
    ) -> Result<PackedMatrix, ModelError> {
        if let Some(Stored::Packed(packed, of_file)) = self.stored(name, &[rows, width])?
            && of_file == dtype
        {
            let scales: Vec<f32> = packed.scales.iter().map(half_of_bits).collect();
            self.all_finite(name, &scales)?;
            return Ok(packed);
        }
        let values = self.floats(name, &[rows, width])?;
        Ok(PackedMatrix::pack(&values, width, dtype))
    }

    fn all_finite(&self, name: &str, values: &[f32]) -> Result<(), ModelError> {
        match values.iter().position(|v| !v.is_finite()) {
            None => Ok(()),
            Some(index) => Err(ModelError::NotFinite {
                source_name: self.source.clone(),
                tensor: name.to_owned(),
                index,
            }),
        }
    }

    /// The rows of a table of integers, each below `limit`.
    pub fn integer_rows(
        &self,
        name: &str,
        columns: usize,
        limit: usize,
    ) -> Result<Vec<Vec<usize>>, ModelError> {
        let Some(file) = &self.tensors else {
            return Ok(vec![vec![0; columns]]);
        };
        let rows = match file.tensor(name) {
            Ok(view) => view.shape().first().copied().unwrap_or(0),
            Err(_) => 0,
        };
        let view = self.view(file, name, &[rows, columns], &[rows, columns])?;
        if view.dtype() != StoredAs::I32 {
            return Err(self.wrong_type(name, "I32", view.dtype()));
        }
        let values: Vec<usize> =
            chunks(view.data()).map(|b| i32::from_le_bytes(b) as usize).collect();
        if let Some(bad) = values.iter().find(|v| **v >= limit) {
            return Err(self.config_error(format!(
                "tensor `{name}` holds {bad}, expected numbers below {limit}"
            )));
        }
        Ok(values.chunks(columns).map(<[usize]>::to_vec).collect())
    }

    /// What the file has under a name; none where weights are random.
    fn stored(&self, name: &str, shape: &[usize]) -> Result<Option<Stored<'_>>, ModelError> {
        let Some(file) = &self.tensors else {
            return Ok(None);
        };
        let found = file.tensor(name);
        let stored_as = found.as_ref().map(TensorView::dtype);
        let row = found.as_ref().ok().and_then(|view| view.shape().last());
        let (dtype, row_bytes) = match (stored_as, shape) {
            (Ok(StoredAs::I8), [_, width]) => (Dtype::Q8_0, *width),
            (Ok(StoredAs::U8), [_, width]) => match q6_bytes(*width) {
                bytes if row == Some(&bytes) => (Dtype::Q6, bytes),
                _ => (Dtype::Q4_0, width / 2),
            },
            _ => {
                let view = self.view(file, name, shape, shape)?;
                return match (view.dtype(), shape.len()) {
                    (StoredAs::F32, _) => Ok(Some(Stored::F32(view.data()))),
                    (StoredAs::F16, _) => Ok(Some(Stored::F16(view.data()))),
                    (StoredAs::I8, n) if n != 2 => {
                        Err(self.wrong_type(name, "F32 or F16", StoredAs::I8))
                    }
                    (other, _) => Err(self.wrong_type(name, "F32, F16, I8 or U8", other)),
                };
            }
        };
        let (rows, width) = (shape[0], shape[1]);
        let numbers = self.view(file, name, &[rows, row_bytes], shape)?;
        if !width.is_multiple_of(BLOCK) {
            return Err(self.wrong_type(name, "F32 or F16", numbers.dtype()));
        }
        let scale_name = format!("{name}.scale");
        let scale_shape = [rows, width / BLOCK];
        let scales = self.view(file, &scale_name, &scale_shape, &scale_shape)?;
        if scales.dtype() != StoredAs::F16 {
            return Err(self.wrong_type(&scale_name, "F16", scales.dtype()));
        }
        let scales: Vec<u16> = chunks(scales.data()).map(u16::from_le_bytes).collect();
        let packed = PackedMatrix::from_file(rows, width, dtype, numbers.data(), &scales);
        Ok(Some(Stored::Packed(packed, dtype)))
    }

    /// A tensor that is stored in the shape `stored`, which stands for `shape`.
    fn view<'f>(
        &self,
        file: &'f SafeTensors<'_>,
        name: &str,
        stored: &[usize],
        shape: &[usize],
    ) -> Result<TensorView<'f>, ModelError> {
        let view = file.tensor(name).map_err(|_| ModelError::MissingTensor {
            source_name: self.source.clone(),
            tensor: name.to_owned(),
            expected: shape.to_vec(),
        })?;
        if view.shape() != stored {
            return Err(ModelError::Shape {
                source_name: self.source.clone(),
                tensor: name.to_owned(),
                expected: stored.to_vec(),
                found: view.shape().to_vec(),
            });
        }
        Ok(view)
    }

    fn wrong_type(&self, name: &str, expected: &'static str, found: StoredAs) -> ModelError {
        ModelError::Type {
            source_name: self.source.clone(),
            tensor: name.to_owned(),
            expected,
            found: format!("{found:?}"),
        }
    }
}

/// A tensor of a file, by how it is to be read.
enum Stored<'a> {
    F32(&'a [u8]),
    F16(&'a [u8]),
    Packed(PackedMatrix, Dtype),
}

impl Stored<'_> {
    fn floats(&self) -> Vec<f32> {
        match self {
            Self::F32(data) => chunks(data).map(f32::from_le_bytes).collect(),
            Self::F16(data) => {
                let bits = chunks(data).map(u16::from_le_bytes);
                bits.map(|bits| half_of_bits(&bits)).collect()
            }
            Self::Packed(matrix, _) => matrix.floats(),
        }
    }
}

fn half_of_bits(bits: &u16) -> f32 {
    half::f16::from_bits(*bits).to_f32()
}

/// The bytes in groups of N; safetensors has checked that none are left over.
fn chunks<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u8; N]> + '_ {
    bytes.as_chunks::<N>().0.iter().copied()
}
