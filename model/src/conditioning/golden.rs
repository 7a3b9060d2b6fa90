//! Checkpoints for the tests: the random weights that `golden/make.py` gave to
//! the reference library, computed here from their names and written as the
//! public files are laid out.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};

/// Shape, base and scale of every tensor.
pub type Manifest = BTreeMap<String, (Vec<usize>, f32, f32)>;

/// What the reference library made of it.
pub struct Golden {
    tensors: SafeTensors<'static>,
    metadata: HashMap<String, String>,
}

impl Golden {
    pub fn open(bytes: &'static [u8]) -> Self {
        let (_, header) = SafeTensors::read_metadata(bytes).unwrap();
        Self {
            tensors: SafeTensors::deserialize(bytes).unwrap(),
            metadata: header.metadata().clone().unwrap(),
        }
    }

    pub fn floats(&self, name: &str) -> Vec<f32> {
        let data = self.tensors.tensor(name).unwrap().data();
        let (values, _) = data.as_chunks::<4>();
        values.iter().map(|b| f32::from_le_bytes(*b)).collect()
    }

    pub fn json<T: serde::de::DeserializeOwned>(&self, key: &str) -> T {
        serde_json::from_str(&self.metadata[key]).unwrap()
    }

    pub fn weights(&self) -> Manifest {
        self.json("weights")
    }
}

/// Writes a checkpoint of these tensors.
pub fn write_checkpoint(path: &Path, manifest: &Manifest) {
    let values: Vec<(&String, &Vec<usize>, Vec<u8>)> = manifest
        .iter()
        .map(|(name, (shape, base, scale))| {
            let numbers = noise(&old_name(name), shape.iter().product());
            let numbers = numbers.flat_map(|v| (base + scale * v).to_le_bytes());
            (name, shape, numbers.collect())
        })
        .collect();
    let views = values.iter().map(|(name, shape, bytes)| {
        let view = TensorView::new(Dtype::F32, shape.to_vec(), bytes).unwrap();
        (name.as_str(), view)
    });
    safetensors::serialize_to_file(views, None, path).unwrap();
}

/// A file of the newer layout has the same numbers under other names.
fn old_name(name: &str) -> String {
    name.replace("parametrizations.weight.original0", "weight_g")
        .replace("parametrizations.weight.original1", "weight_v")
}

/// Numbers from -1 to 1 that follow from a name, as `noise` in `make.py`.
pub fn noise(name: &str, count: usize) -> impl Iterator<Item = f32> + use<> {
    let seed = name
        .bytes()
        .fold(2_166_136_261_u32, |seed, byte| (seed ^ u32::from(byte)).wrapping_mul(16_777_619));
    (0..count as u32).map(move |i| {
        let mut h = i.wrapping_mul(0x9E37_79B1).wrapping_add(seed);
        h = (h ^ (h >> 16)).wrapping_mul(0x85EB_CA6B);
        h = (h ^ (h >> 13)).wrapping_mul(0xC2B2_AE35);
        h ^= h >> 16;
        (h >> 8) as f32 / 8_388_608.0 - 1.0
    })
}

/// Fails unless all numbers agree to `tolerance`.
pub fn check_same(what: &str, found: &[f32], expected: &[f32], tolerance: f32) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let gaps = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    let worst = gaps.fold(0.0, f32::max);
    assert!(worst <= tolerance, "{what}: off by {worst}");
}
