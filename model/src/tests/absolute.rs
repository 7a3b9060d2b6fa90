//! Absolute positions and sequences that end, against the PyTorch twin:
//! `golden/absolute.safetensors` is written by `model/reference/golden_absolute.py`.

use std::collections::BTreeMap;

use safetensors::SafeTensors;

use super::{TINY, check_same, code_rows, danced_at_once, floats, hidden, slices};
use crate::config::Positions;
use crate::engine::EngineKind;
use crate::weights::Weights;
use crate::weights::tensor_file::{self, Entry};

const GOLDEN: &[u8] = include_bytes!("golden/absolute.safetensors");

/// The tiny model with absolute positions and one row more in its first head.
fn with_end() -> Vec<u8> {
    let tensors = SafeTensors::deserialize(TINY).unwrap();
    let (_, header) = SafeTensors::read_metadata(TINY).unwrap();
    let mut metadata: BTreeMap<String, String> =
        header.metadata().clone().unwrap().into_iter().collect();
    let config = metadata.get_mut("config").unwrap();
    let more = r#""eos":true,"positions":"sinusoidal","music_at_input""#;
    *config = config.replace(r#""music_at_input""#, more);
    let tensors = tensors.tensors().into_iter().map(|(name, view)| {
        let (mut shape, mut data) = (view.shape().to_vec(), view.data().to_vec());
        if name == "seq.head.lower.weight" {
            shape[0] += 1;
            let row = (0..shape[1]).map(|k| (0.2 * (k as f64).sin()) as f32);
            data.extend(row.flat_map(f32::to_le_bytes));
        } else if name == "seq.head.lower.bias" {
            shape[0] += 1;
            data.extend(0.5f32.to_le_bytes());
        }
        (name, view.dtype(), shape, data)
    });
    let tensors: Vec<_> = tensors.collect();
    let entries =
        tensors.iter().map(|(name, dtype, shape, data)| Entry { name, dtype: *dtype, shape, data });
    tensor_file::bytes(&metadata, entries.collect())
}

fn golden(name: &str) -> Vec<f32> {
    let golden = SafeTensors::deserialize(GOLDEN).unwrap();
    let (values, _) = golden.tensor(name).unwrap().data().as_chunks::<4>();
    values.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

#[test]
fn both_ways_of_computing_agree_with_the_twin() {
    let bytes = with_end();
    let weights = Weights::open(&bytes, "with an end").unwrap();
    assert_eq!(weights.config().seq.positions, Positions::Sinusoidal);
    let codes = code_rows("codes");
    let mut previous = codes.clone();
    previous.rotate_right(1);
    previous[0].clone_from(&codes[0]);
    let music = floats("music");
    let (seq, mut whole) = danced_at_once(&weights, &previous, Some(&music), Some(1));
    check_same("hidden", whole.hidden(), &golden("hidden"));
    for (code, classes) in [(0, 17), (1, 16), (2, 16)] {
        let logits = seq.logits(&mut whole, code, &slices(&codes)).unwrap();
        assert_eq!(logits.len(), classes * codes.len());
        check_same("logits", logits, &golden(&format!("logits{code}")));
    }
    for kind in EngineKind::ALL {
        let [streamed, _] = hidden(&weights, kind, &previous, &music, 1);
        check_same("streamed", &streamed, &golden("hidden"));
    }
}
