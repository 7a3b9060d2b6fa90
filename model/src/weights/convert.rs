//! A weights file in another number format.

use std::collections::BTreeMap;
use std::path::Path;

use half::f16;
use safetensors::tensor::{Dtype as Stored, SafeTensors, TensorView};

use super::tensor_file::{self, Entry};
use super::{BLOCK, Dtype, PackedMatrix, Weights};
use crate::error::ModelError;

struct Tensor {
    name: String,
    dtype: Stored,
    shape: Vec<usize>,
    data: Vec<u8>,
}

/// What the names of the encoders' tensors begin with; a dance reads none of them.
pub const ENCODERS: &str = "vq.encoder.";

/// Which tensors a converted file keeps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Keep {
    /// All that there are.
    #[default]
    Everything,
    /// Those of a dance: without encoders, motion cannot be turned into codes
    /// ([`crate::Codec`]).
    Dance,
    /// The encoders and what they need: codebooks, and what normalises motion.
    Encoders,
}

impl Keep {
    fn has(self, name: &str) -> bool {
        let encodes = name.starts_with(ENCODERS);
        match self {
            Self::Everything => true,
            Self::Dance => !encodes,
            Self::Encoders => {
                encodes || name.starts_with("vq.codebook.") || name.starts_with("norm.motion_")
            }
        }
    }
}

/// The bytes of the file `bytes` (called `source` in errors) with its
/// matrices in `dtype`. Tables, biases and norms become f16 (f32 where the
/// matrices do); what normalises data stays f32, integers stay what they are.
/// Every number is checked.
pub fn convert(
    bytes: &[u8],
    source: &str,
    dtype: Dtype,
    keep: Keep,
) -> Result<Vec<u8>, ModelError> {
    let file = |reason: String| ModelError::File { source_name: source.to_owned(), reason };
    let weights = Weights::open(bytes, source)?;
    let tensors = SafeTensors::deserialize(bytes).map_err(|e| file(e.to_string()))?;
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| file(e.to_string()))?;
    let metadata: BTreeMap<String, String> =
        header.metadata().clone().unwrap_or_default().into_iter().collect();
    let mut names = tensors.names();
    names.sort_unstable();
    let mut converted = Vec::with_capacity(names.len());
    for name in names {
        let view = tensors.tensor(name).map_err(|e| file(e.to_string()))?;
        if !keep.has(name) || is_scale(name, &tensors) {
            continue;
        }
        converted.extend(one(&weights, name, &view, dtype)?);
    }
    let entries = converted.iter().map(|t| Entry {
        name: &t.name,
        dtype: t.dtype,
        shape: &t.shape,
        data: &t.data,
    });
    Ok(tensor_file::bytes(&metadata, entries.collect()))
}

/// The same from file to bytes.
pub fn convert_file(path: &Path, dtype: Dtype, keep: Keep) -> Result<Vec<u8>, ModelError> {
    convert(&Weights::read(path)?, &path.display().to_string(), dtype, keep)
}

/// Whether the tensor is the scale of a quantised one.
fn is_scale(name: &str, tensors: &SafeTensors) -> bool {
    let of = name.strip_suffix(".scale").and_then(|of| tensors.tensor(of).ok());
    of.is_some_and(|of| matches!(of.dtype(), Stored::I8 | Stored::U8))
}

/// Whether vectors are multiplied with it in whole blocks (tables are looked up).
fn is_matrix(name: &str, shape: &[usize]) -> bool {
    let looked_up = ["seq.embed.", "seq.given.", "seq.style."];
    matches!(shape, [_, width] if width.is_multiple_of(BLOCK))
        && name.ends_with(".weight")
        && !looked_up.iter().any(|table| name.starts_with(table))
}

fn one(
    weights: &Weights,
    name: &str,
    view: &TensorView,
    dtype: Dtype,
) -> Result<Vec<Tensor>, ModelError> {
    let tensor = |name: &str, dtype, shape: &[usize], data| Tensor {
        name: name.to_owned(),
        dtype,
        shape: shape.to_vec(),
        data,
    };
    let mut shape = view.shape().to_vec();
    match view.dtype() {
        Stored::U8 if shape.len() == 2 => {
            let columns = weights.quantised_columns(name);
            shape[1] = columns.unwrap_or(2 * shape[1]);
        }
        Stored::F32 | Stored::F16 | Stored::I8 => {}
        other => return Ok(vec![tensor(name, other, &shape, view.data().to_vec())]),
    }
    let values = weights.floats(name, &shape)?;
    if name.starts_with("norm.") || dtype == Dtype::F32 {
        let data = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        return Ok(vec![tensor(name, Stored::F32, &shape, data)]);
    }
    if dtype == Dtype::F16 || !is_matrix(name, &shape) {
        let data = values.iter().flat_map(|v| f16::from_f32(*v).to_le_bytes());
        return Ok(vec![tensor(name, Stored::F16, &shape, data.collect())]);
    }
    let [rows, width] = [shape[0], shape[1]];
    let (bytes, scales) = PackedMatrix::pack(&values, width, dtype).to_file();
    let stored = match dtype {
        Dtype::Q8_0 => Stored::I8,
        _ => Stored::U8,
    };
    let packed_shape = [rows, bytes.len() / rows.max(1)];
    let scales = scales.into_iter().flat_map(u16::to_le_bytes);
    let scale_name = format!("{name}.scale");
    Ok(vec![
        tensor(name, stored, &packed_shape, bytes),
        tensor(&scale_name, Stored::F16, &[rows, width / BLOCK], scales.collect()),
    ])
}
