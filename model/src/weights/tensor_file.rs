//! Safetensors files whose bytes follow from what is in them: the same tensors
//! and metadata, the same bytes. (The crate's own writer takes metadata as they
//! come out of a hash map, so that equal data had unequal hashes.)

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::io::{self, Write};

use safetensors::tensor::Dtype;

/// A tensor to be written.
#[derive(Clone, Copy, Debug)]
pub struct Entry<'a> {
    /// The name, once in a file.
    pub name: &'a str,
    /// Number format of `data`.
    pub dtype: Dtype,
    /// Sizes, the slowest dimension first.
    pub shape: &'a [usize],
    /// The numbers, little endian.
    pub data: &'a [u8],
}

/// Writes a whole file. Wide numbers come first, so that all are aligned.
pub fn write(
    out: &mut impl Write,
    metadata: &BTreeMap<String, String>,
    mut tensors: Vec<Entry>,
) -> io::Result<()> {
    out.write_all(&header(metadata, &mut tensors))?;
    tensors.iter().try_for_each(|t| out.write_all(t.data))
}

/// The same in memory.
pub fn bytes(metadata: &BTreeMap<String, String>, mut tensors: Vec<Entry>) -> Vec<u8> {
    let mut out = header(metadata, &mut tensors);
    tensors.iter().for_each(|t| out.extend(t.data));
    out
}

/// What stands before the numbers, and the order that these come in.
fn header(metadata: &BTreeMap<String, String>, tensors: &mut [Entry]) -> Vec<u8> {
    tensors.sort_by_key(|t| (Reverse(t.dtype.bitsize()), t.name));
    let mut entries = vec![entry("__metadata__", &serde_json::json!(metadata))];
    let mut end = 0;
    for t in tensors {
        let start = end;
        end += t.data.len();
        let described = BTreeMap::from([
            ("data_offsets", serde_json::json!([start, end])),
            ("dtype", serde_json::json!(t.dtype)),
            ("shape", serde_json::json!(t.shape)),
        ]);
        entries.push(entry(t.name, &serde_json::json!(described)));
    }
    let mut header = format!("{{{}}}", entries.join(",")).into_bytes();
    header.resize(header.len().next_multiple_of(8), b' ');
    let mut out = (header.len() as u64).to_le_bytes().to_vec();
    out.extend(header);
    out
}

fn entry(name: &str, value: &serde_json::Value) -> String {
    format!("{}:{value}", serde_json::json!(name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use safetensors::SafeTensors;

    #[test]
    fn what_is_written_is_read_and_comes_in_one_order() {
        let numbers: Vec<u8> = (0..24).collect();
        let tensor = |name, dtype, shape, bytes: usize| Entry {
            name,
            dtype,
            shape,
            data: &numbers[..bytes],
        };
        let metadata: BTreeMap<String, String> =
            (0..20).map(|i| (format!("key {i}"), format!("\"{i}\""))).collect();
        let a = tensor("a \"quoted\" name", Dtype::I8, &[3], 3);
        let b = tensor("b", Dtype::F32, &[2, 3], 24);
        let c = tensor("c", Dtype::I64, &[0], 0);
        let file = bytes(&metadata, vec![a, b, c]);
        let mut written = Vec::new();
        write(&mut written, &metadata, vec![c, b, a]).unwrap();
        assert_eq!(file, written);
        let back = SafeTensors::deserialize(&file).unwrap();
        assert_eq!(back.tensor("b").unwrap().data(), numbers);
        assert_eq!(back.tensor("a \"quoted\" name").unwrap().shape(), [3]);
        let (_, header) = SafeTensors::read_metadata(&file).unwrap();
        let found = header.metadata().as_ref().unwrap();
        assert!(found.len() == 20 && found.iter().all(|(k, v)| metadata[k] == *v));
    }
}
