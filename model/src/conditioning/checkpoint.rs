//! A public checkpoint as its authors publish it: safetensors, read one tensor
//! at a time.
//!
//! CLIP's file is 600 MB, of which the text half is wanted: only the header and
//! what is asked for come into memory. Every tensor is checked as it is taken
//! out: name, shape, number format, and that each number is finite. A download
//! that broke off is told before anything is read.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use candle_core::{Device, Tensor};
use serde::Deserialize;

use crate::engine::candle::TensorSource;
use crate::error::ModelError;

/// What a file begins with that was cloned without its content.
const LFS_POINTER: &[u8; 8] = b"version ";
/// Headers of real checkpoints are some hundred KiB.
const HEADER_MAX: u64 = 100_000_000;

#[derive(Debug, Deserialize)]
struct Entry {
    dtype: String,
    shape: Vec<usize>,
    data_offsets: (u64, u64),
}

/// An open checkpoint whose header was checked.
#[derive(Debug)]
pub struct Checkpoint {
    path: PathBuf,
    file: Mutex<File>,
    entries: BTreeMap<String, Entry>,
    data_start: u64,
}

impl Checkpoint {
    /// Opens a file and checks that it is whole.
    pub fn open(path: &Path) -> Result<Self, ModelError> {
        let failed = |reason: String| file_error(path, reason);
        let read = |error: std::io::Error| failed(error.to_string());
        let mut file = File::open(path).map_err(read)?;
        let length = file.metadata().map_err(read)?.len();
        let mut size = [0; 8];
        let torn = |_| failed("not a safetensors file: it ends within its header".into());
        file.read_exact(&mut size).map_err(torn)?;
        if &size == LFS_POINTER {
            return Err(failed("a Git LFS pointer, not the file itself: download it whole".into()));
        }
        let header_size = u64::from_le_bytes(size);
        if header_size > HEADER_MAX.min(length - 8) {
            return Err(failed(format!(
                "not a whole safetensors file: {length} bytes, its header alone asks for {header_size}"
            )));
        }
        let mut header = vec![0; header_size as usize];
        file.read_exact(&mut header).map_err(read)?;
        let entries = entries(&header)
            .map_err(|reason| failed(format!("not a safetensors file: {reason}")))?;
        let data_start = 8 + header_size;
        let end = entries.values().map(|e| e.data_offsets.1).max();
        let wanted = data_start.saturating_add(end.unwrap_or(0));
        if length < wanted {
            return Err(failed(format!(
                "not whole: {length} bytes of {wanted}, as if a download broke off"
            )));
        }
        Ok(Self { path: path.to_owned(), file: Mutex::new(file), entries, data_start })
    }

    /// Whether the file has a tensor of this name.
    pub fn has(&self, name: &str) -> bool {
        self.entries.contains_key(name)
    }

    /// A tensor of exactly this shape, as f32 on the CPU.
    pub fn tensor(&self, name: &str, shape: &[usize]) -> Result<Tensor, ModelError> {
        let entry = self.entry(name, shape)?;
        let bytes = self
            .bytes(entry)
            .map_err(|e| file_error(&self.path, format!("tensor `{name}`: {e}")))?;
        let values: Vec<f32> = match entry.dtype.as_str() {
            "F32" => chunks(&bytes).map(f32::from_le_bytes).collect(),
            "F16" => chunks(&bytes).map(|b| half::f16::from_le_bytes(b).to_f32()).collect(),
            "BF16" => chunks(&bytes).map(|b| half::bf16::from_le_bytes(b).to_f32()).collect(),
            other => {
                return Err(ModelError::Type {
                    source_name: self.source(),
                    tensor: name.to_owned(),
                    expected: "F32, F16 or BF16",
                    found: other.to_owned(),
                });
            }
        };
        if let Some(index) = values.iter().position(|v| !v.is_finite()) {
            return Err(ModelError::NotFinite {
                source_name: self.source(),
                tensor: name.to_owned(),
                index,
            });
        }
        if values.len() != shape.iter().product::<usize>() {
            let reason = format!("tensor `{name}`: {} numbers for {shape:?}", values.len());
            return Err(file_error(&self.path, reason));
        }
        Ok(Tensor::from_vec(values, shape, &Device::Cpu)?)
    }

    fn entry(&self, name: &str, shape: &[usize]) -> Result<&Entry, ModelError> {
        let entry = self.entries.get(name);
        let entry = entry.ok_or_else(|| ModelError::MissingTensor {
            source_name: self.source(),
            tensor: name.to_owned(),
            expected: shape.to_vec(),
        })?;
        if entry.shape != shape {
            return Err(ModelError::Shape {
                source_name: self.source(),
                tensor: name.to_owned(),
                expected: shape.to_vec(),
                found: entry.shape.clone(),
            });
        }
        Ok(entry)
    }

    fn bytes(&self, entry: &Entry) -> std::io::Result<Vec<u8>> {
        let (start, end) = entry.data_offsets;
        let mut bytes = vec![0; end.saturating_sub(start) as usize];
        let mut file = self.file.lock().unwrap_or_else(|e| e.into_inner());
        file.seek(SeekFrom::Start(self.data_start + start))?;
        file.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    fn source(&self) -> String {
        self.path.display().to_string()
    }
}

fn entries(header: &[u8]) -> Result<BTreeMap<String, Entry>, String> {
    let mut listed: BTreeMap<String, serde_json::Value> =
        serde_json::from_slice(header).map_err(|e| e.to_string())?;
    listed.remove("__metadata__");
    listed
        .into_iter()
        .map(|(name, value)| {
            let entry = serde_json::from_value(value).map_err(|e| format!("`{name}`: {e}"))?;
            Ok((name, entry))
        })
        .collect()
}

impl TensorSource for Checkpoint {
    fn tensor(&self, name: &str, shape: &[usize]) -> Result<Tensor, ModelError> {
        Checkpoint::tensor(self, name, shape)
    }
}

fn chunks<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u8; N]> + '_ {
    bytes.as_chunks::<N>().0.iter().copied()
}

/// An error about the file at `path`.
pub fn file_error(path: &Path, reason: String) -> ModelError {
    ModelError::File { source_name: path.display().to_string(), reason }
}
