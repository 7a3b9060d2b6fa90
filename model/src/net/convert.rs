//! A weights file in another number format.

use std::collections::BTreeMap;
use std::path::Path;

use half::f16;
use safetensors::tensor::{Dtype as Stored, SafeTensors, TensorView};

use super::engine::{BLOCK, CHUNK, Dtype, q4_block, q6_chunk, q8_block};
use super::weights::{Weights, q6_bytes};
use crate::error::ModelError;
use crate::tensor_file::{self, Entry};

/// One tensor of the new file.
struct Tensor {
    name: String,
    dtype: Stored,
    shape: Vec<usize>,
    data: Vec<u8>,
}

/// The bytes of the file `bytes` (called `source` in errors) with its matrices
/// in `dtype`. Tables, biases and norms become f16 (f32 where the matrices do);
/// what normalises data stays f32, integers stay what they are. Every number is
/// checked.
pub fn convert(bytes: &[u8], source: &str, dtype: Dtype) -> Result<Vec<u8>, ModelError> {
    let file = |reason: String| ModelError::File {
        source_name: source.to_owned(),
        reason,
    };
    let weights = Weights::open(bytes, source)?;
    let tensors = SafeTensors::deserialize(bytes).map_err(|e| file(e.to_string()))?;
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| file(e.to_string()))?;
    let metadata: BTreeMap<String, String> = header
        .metadata()
        .clone()
        .unwrap_or_default()
        .into_iter()
        .collect();
    let mut names = tensors.names();
    names.sort_unstable();
    let mut converted = Vec::with_capacity(names.len());
    for name in names {
        let view = tensors.tensor(name).map_err(|e| file(e.to_string()))?;
        if is_scale(name, &tensors) {
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
pub fn convert_file(path: &Path, dtype: Dtype) -> Result<Vec<u8>, ModelError> {
    convert(&Weights::read(path)?, &path.display().to_string(), dtype)
}

/// Whether the tensor is the scale of a quantised one.
fn is_scale(name: &str, tensors: &SafeTensors) -> bool {
    let of = name
        .strip_suffix(".scale")
        .and_then(|of| tensors.tensor(of).ok());
    of.is_some_and(|of| matches!(of.dtype(), Stored::I8 | Stored::U8))
}

/// Whether vectors are multiplied with it, in whole blocks: not a table that is
/// looked up.
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
    let packed = values.chunks_exact(width).map(|row| packed_row(row, dtype));
    let (quants, scales): (Vec<_>, Vec<_>) = packed.unzip();
    let (stored, row_bytes) = match dtype {
        Dtype::Q8_0 => (Stored::I8, width),
        Dtype::Q6 => (Stored::U8, q6_bytes(width)),
        _ => (Stored::U8, width / 2),
    };
    let scales = scales.concat().into_iter().flat_map(f16::to_le_bytes);
    let scale_shape = [rows, width / BLOCK];
    let scale_name = format!("{name}.scale");
    Ok(vec![
        tensor(name, stored, &[rows, row_bytes], quants.concat()),
        tensor(&scale_name, Stored::F16, &scale_shape, scales.collect()),
    ])
}

/// Bytes and scales of a row of whole blocks in a quantised format.
fn packed_row(row: &[f32], dtype: Dtype) -> (Vec<u8>, Vec<f16>) {
    let blocks = row.as_chunks::<BLOCK>().0;
    match dtype {
        Dtype::Q6 => {
            let (mut bytes, mut scales) = (Vec::new(), Vec::new());
            for part in row.chunks(CHUNK) {
                let mut chunk = [0.0; CHUNK];
                chunk[..part.len()].copy_from_slice(part);
                let (words, of_chunk) = q6_chunk(&chunk);
                bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
                scales.extend_from_slice(&of_chunk[..part.len() / BLOCK]);
            }
            (bytes, scales)
        }
        Dtype::Q4_0 => {
            let (bytes, scales): (Vec<_>, _) = blocks.iter().map(q4_block).unzip();
            (bytes.concat(), scales)
        }
        _ => {
            let (quants, scales): (Vec<_>, _) = blocks.iter().map(q8_block).unzip();
            let quants = quants.concat().into_iter();
            (quants.map(|q| q as u8).collect(), scales)
        }
    }
}
