//! Named tensors as the bytes of a safetensors file, and back.

use std::collections::BTreeMap;

use safetensors::tensor::{Dtype, SafeTensors};

use servodance_model::weights::tensor_file::{self, Entry};

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Numbers {
    F32(Vec<f32>),
    F64(Vec<f64>),
    I32(Vec<i32>),
}

impl Numbers {
    fn bytes(&self) -> Vec<u8> {
        match self {
            Numbers::F32(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
            Numbers::F64(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
            Numbers::I32(v) => v.iter().flat_map(|x| x.to_le_bytes()).collect(),
        }
    }

    fn dtype(&self) -> Dtype {
        match self {
            Numbers::F32(_) => Dtype::F32,
            Numbers::F64(_) => Dtype::F64,
            Numbers::I32(_) => Dtype::I32,
        }
    }
}

pub(crate) type Tensors = BTreeMap<String, (Vec<usize>, Numbers)>;

pub(crate) fn file(metadata: &BTreeMap<String, String>, tensors: &Tensors) -> Vec<u8> {
    let bytes: Vec<Vec<u8>> = tensors.values().map(|(_, numbers)| numbers.bytes()).collect();
    let entries = tensors.iter().zip(&bytes);
    let entries = entries.map(|((name, (shape, numbers)), data)| Entry {
        name,
        dtype: numbers.dtype(),
        shape,
        data,
    });
    tensor_file::bytes(metadata, entries.collect())
}

/// Tensors whose names begin with one of `prefixes`; f16 becomes f32.
pub(crate) fn read(bytes: &[u8], prefixes: &[&str]) -> Result<Tensors, String> {
    let file = SafeTensors::deserialize(bytes).map_err(|e| e.to_string())?;
    let wanted = |name: &str| prefixes.iter().any(|prefix| name.starts_with(prefix));
    let mut tensors = Tensors::new();
    for (name, view) in file.tensors().into_iter().filter(|(name, _)| wanted(name)) {
        let data = view.data();
        let four = || data.as_chunks::<4>().0.iter();
        let numbers = match view.dtype() {
            Dtype::F32 => Numbers::F32(four().map(|b| f32::from_le_bytes(*b)).collect()),
            Dtype::I32 => Numbers::I32(four().map(|b| i32::from_le_bytes(*b)).collect()),
            Dtype::F16 => {
                let halves = data.as_chunks::<2>().0.iter();
                Numbers::F32(halves.map(|b| half::f16::from_le_bytes(*b).to_f32()).collect())
            }
            Dtype::F64 => {
                let eight = data.as_chunks::<8>().0.iter();
                Numbers::F64(eight.map(|b| f64::from_le_bytes(*b)).collect())
            }
            other => return Err(format!("tensor `{name}` has type {other:?}")),
        };
        tensors.insert(name, (view.shape().to_vec(), numbers));
    }
    Ok(tensors)
}

pub(crate) fn floats(tensors: &Tensors, name: &str, count: usize) -> Result<Vec<f32>, String> {
    match tensors.get(name) {
        Some((_, Numbers::F32(values))) if values.len() == count => Ok(values.clone()),
        Some((shape, _)) => {
            Err(format!("tensor `{name}` has shape {shape:?}, expected {count} numbers"))
        }
        None => Err(format!("tensor `{name}` is missing")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let tensors = Tensors::from([
            ("a".to_owned(), (vec![2, 1], Numbers::F32(vec![1.5, -2.0]))),
            ("b".to_owned(), (vec![1], Numbers::F64(vec![0.1]))),
            ("c".to_owned(), (vec![3], Numbers::I32(vec![1, 2, -3]))),
        ]);
        let metadata = BTreeMap::from([("format".to_owned(), "x".to_owned())]);
        let bytes = file(&metadata, &tensors);
        assert_eq!(read(&bytes, &["a", "b", "c"]).unwrap(), tensors);
        assert_eq!(read(&bytes, &["b"]).unwrap().len(), 1);
        let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
        assert_eq!(header.metadata().as_ref().unwrap()["format"], "x");
        assert!(read(&bytes[..bytes.len() - 1], &[""]).is_err());
    }
}
