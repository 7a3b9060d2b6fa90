//! The weights file: safetensors with the configuration in its metadata.
//!
//! Everything is checked when it is taken out: name, shape, number format,
//! and that each number is finite. A matrix `NAME` [rows, columns] is F32 or
//! F16; or, quantised in blocks of 32 columns, I8 [rows, columns] (`q8_0`), U8
//! [rows, 96 for each 128 columns begun] (`q6`) or U8 [rows, columns / 2]
//! (`q4_0`), with `NAME.scale`, F16 [rows, columns / 32], beside it.

use std::path::Path;

use candle_core::{Device, Tensor};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use super::config::ModelConfig;
use super::engine::{BLOCK, CHUNK, CHUNK_WORDS, Dtype as Packed, Matrix, q4_values, q6_values};
use super::random;
use crate::error::ModelError;

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
    pub fn dtype(&self) -> Packed {
        let Some(file) = &self.tensors else {
            return Packed::F32;
        };
        let stored = file.iter().map(|(name, view)| match view.dtype() {
            Dtype::U8 => self.format_of_bytes(name, &view),
            Dtype::I8 => Packed::Q8_0,
            Dtype::F16 => Packed::F16,
            _ => Packed::F32,
        });
        let narrowness = |dtype: &Packed| Packed::ALL.iter().position(|d| d == dtype);
        stored.max_by_key(narrowness).unwrap_or(Packed::F32)
    }

    /// Columns of a quantised matrix, as its scales tell.
    pub(crate) fn quantised_columns(&self, name: &str) -> Option<usize> {
        let scales = self
            .tensors
            .as_ref()?
            .tensor(&format!("{name}.scale"))
            .ok()?;
        Some(scales.shape().last()?.saturating_mul(BLOCK))
    }

    /// The format of a matrix that is stored as bytes.
    fn format_of_bytes(&self, name: &str, view: &TensorView) -> Packed {
        let wanted = self.quantised_columns(name).map(q6_bytes);
        match wanted.is_some() && view.shape().last() == wanted.as_ref() {
            true => Packed::Q6,
            false => Packed::Q4_0,
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
        dtype: Packed,
    ) -> Result<Matrix, ModelError> {
        let stored = self.stored(name, &[rows, width])?;
        match (stored, dtype) {
            (Some(Stored::Q8 { quants, scales }), Packed::Q8_0) => {
                self.all_finite(name, &halves(scales))?;
                let quants = quants.iter().map(|b| *b as i8).collect();
                Ok(Matrix::from_q8(width, quants, &raw_halves(scales)))
            }
            (Some(Stored::Q6 { words, scales, .. }), Packed::Q6) => {
                self.all_finite(name, &halves(scales))?;
                Ok(Matrix::from_q6(
                    width,
                    raw_halves(words),
                    &raw_halves(scales),
                ))
            }
            (Some(Stored::Q4 { quants, scales }), Packed::Q4_0) => {
                self.all_finite(name, &halves(scales))?;
                Ok(Matrix::from_q4(width, quants.to_vec(), &raw_halves(scales)))
            }
            _ => Ok(Matrix::pack(
                &self.floats(name, &[rows, width])?,
                width,
                dtype,
            )),
        }
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

    /// What the file has under a name; none where weights are random.
    fn stored(&self, name: &str, shape: &[usize]) -> Result<Option<Stored<'_>>, ModelError> {
        let Some(file) = &self.tensors else {
            return Ok(None);
        };
        let found = file.tensor(name);
        let dtype = found.as_ref().map(TensorView::dtype);
        let row = found.as_ref().ok().and_then(|view| view.shape().last());
        let packed = match (dtype, shape) {
            (Ok(Dtype::I8), _) => shape.to_vec(),
            (Ok(Dtype::U8), [rows, width]) => match q6_bytes(*width) {
                bytes if row == Some(&bytes) => vec![*rows, bytes],
                _ => vec![*rows, width / 2],
            },
            _ => {
                let view = self.view(file, name, shape, shape)?;
                return match view.dtype() {
                    Dtype::F32 => Ok(Some(Stored::F32(view.data()))),
                    Dtype::F16 => Ok(Some(Stored::F16(view.data()))),
                    other => Err(self.wrong_type(name, "F32, F16, I8 or U8", other)),
                };
            }
        };
        let quants = self.view(file, name, &packed, shape)?;
        let [rows, width] = shape else {
            return Err(self.wrong_type(name, "F32 or F16", quants.dtype()));
        };
        if !width.is_multiple_of(BLOCK) {
            return Err(self.wrong_type(name, "F32 or F16", quants.dtype()));
        }
        let scale_name = format!("{name}.scale");
        let scale_shape = [*rows, width / BLOCK];
        let scales = self.view(file, &scale_name, &scale_shape, &scale_shape)?;
        if scales.dtype() != Dtype::F16 {
            return Err(self.wrong_type(&scale_name, "F16", scales.dtype()));
        }
        let (quants, scales) = (quants.data(), scales.data());
        Ok(Some(match dtype {
            Ok(Dtype::U8) if packed[1] == q6_bytes(*width) => Stored::Q6 {
                words: quants,
                scales,
                width: *width,
            },
            Ok(Dtype::U8) => Stored::Q4 { quants, scales },
            _ => Stored::Q8 { quants, scales },
        }))
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

    fn wrong_type(&self, name: &str, expected: &'static str, found: Dtype) -> ModelError {
        ModelError::Type {
            source_name: self.source.clone(),
            tensor: name.to_owned(),
            expected,
            found: format!("{found:?}"),
        }
    }
}

/// The bytes of a tensor, by how they are to be read.
enum Stored<'a> {
    F32(&'a [u8]),
    F16(&'a [u8]),
    Q8 {
        quants: &'a [u8],
        scales: &'a [u8],
    },
    Q6 {
        words: &'a [u8],
        scales: &'a [u8],
        width: usize,
    },
    Q4 {
        quants: &'a [u8],
        scales: &'a [u8],
    },
}

/// Bytes of a row of `q6` chunks.
pub(crate) fn q6_bytes(width: usize) -> usize {
    width.div_ceil(CHUNK).saturating_mul(2 * CHUNK_WORDS)
}

impl Stored<'_> {
    fn floats(&self) -> Vec<f32> {
        match self {
            Self::F32(data) => chunks(data).map(f32::from_le_bytes).collect(),
            Self::F16(data) => halves(data),
            Self::Q8 { quants, scales } => {
                let blocks = quants.chunks_exact(BLOCK).zip(halves(scales));
                let block = |(block, scale): (&[u8], f32)| -> [f32; BLOCK] {
                    std::array::from_fn(|i| f32::from(block[i] as i8) * scale)
                };
                blocks.flat_map(block).collect()
            }
            Self::Q6 {
                words,
                scales,
                width,
            } => {
                let (words, scales) = (raw_halves(words), raw_halves(scales));
                let rows = words.chunks_exact(q6_bytes(*width) / 2);
                let rows = rows.zip(scales.chunks_exact(width / BLOCK));
                rows.flat_map(|(words, scales)| q6_row(words, scales, *width))
                    .collect()
            }
            Self::Q4 { quants, scales } => {
                let scales = raw_halves(scales).into_iter().map(half::f16::from_bits);
                let blocks = quants.chunks_exact(BLOCK / 2).zip(scales);
                blocks.flat_map(|(b, scale)| q4_values(b, scale)).collect()
            }
        }
    }
}

/// The numbers of a row of `q6` chunks, without what it was filled up with.
fn q6_row(words: &[u16], scales: &[u16], width: usize) -> Vec<f32> {
    let scales = scales.chunks(CHUNK / BLOCK).map(|given| {
        std::array::from_fn(|i| half::f16::from_bits(given.get(i).copied().unwrap_or(0)))
    });
    let chunks = words.as_chunks().0.iter().zip(scales);
    let mut row: Vec<f32> = chunks.flat_map(|(w, s)| q6_values(w, s)).collect();
    row.truncate(width);
    row
}

/// f16 numbers as f32.
fn halves(data: &[u8]) -> Vec<f32> {
    let values = chunks(data).map(half::f16::from_le_bytes);
    values.map(half::f16::to_f32).collect()
}

/// The bits of f16 numbers.
fn raw_halves(data: &[u8]) -> Vec<u16> {
    chunks(data).map(u16::from_le_bytes).collect()
}

/// The bytes in groups of N; safetensors has checked that none are left over.
fn chunks<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u8; N]> + '_ {
    bytes.as_chunks::<N>().0.iter().copied()
}
