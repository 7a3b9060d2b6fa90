//! Weights files that are refused, and what is said of them.

use safetensors::SafeTensors;

use super::TINY;
use crate::weights::{Dtype, Keep, Weights, convert};
use crate::{Generator, ModelError};

/// The tiny file with one change to its header or data.
fn broken(change: impl Fn(&mut Vec<u8>)) -> ModelError {
    let mut bytes = TINY.to_vec();
    change(&mut bytes);
    Generator::from_bytes(&bytes, "broken").unwrap_err()
}

/// Replaces text in the header by text of the same length.
fn swap(bytes: &mut [u8], from: &str, to: &str) {
    assert_eq!(from.len(), to.len());
    let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
    bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
}

#[test]
fn a_truncated_file_is_refused() {
    let error = broken(|bytes| bytes.truncate(100_000));
    assert!(matches!(error, ModelError::File { .. }), "{error}");
    let error = broken(|bytes| bytes.truncate(5));
    assert!(matches!(error, ModelError::File { .. }), "{error}");
}

#[test]
fn a_missing_tensor_is_named_with_its_shape() {
    let error = broken(|bytes| swap(bytes, "seq.head.upper.bias", "seq.head.uppex.bias"));
    let text = error.to_string();
    assert!(text.contains("seq.head.upper.bias") && text.contains("[16]"), "{text}");
}

#[test]
fn sizes_that_do_not_match_the_tensors_are_named() {
    let error = broken(|bytes| swap(bytes, r#"\"codes\":16"#, r#"\"codes\":15"#));
    let text = error.to_string();
    assert!(matches!(error, ModelError::Config { .. } | ModelError::Shape { .. }), "{text}");
    let error = broken(|bytes| swap(bytes, r#"\"code_dim\":8"#, r#"\"code_dim\":9"#));
    let text = error.to_string();
    assert!(text.contains("[16, 9]") && text.contains("[16, 8]"), "{text}");
}

#[test]
fn a_configuration_of_another_kind_is_refused() {
    let error = broken(|bytes| swap(bytes, r#"\"music_dim\":39"#, r#"\"music_dim\":35"#));
    assert!(error.to_string().contains("music_dim is 35, expected 39"), "{error}");
    let error = broken(|bytes| swap(bytes, "servodance-model-1", "servodance-model-7"));
    assert!(error.to_string().contains("servodance-model-7"), "{error}");
}

#[test]
fn a_weight_that_is_not_a_number_is_refused() {
    let error = broken(|bytes| {
        let header = u64::from_le_bytes(*bytes.first_chunk().unwrap()) as usize;
        let at = 8 + header + 40_000;
        bytes[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    });
    assert!(matches!(error, ModelError::NotFinite { .. }), "{error}");
}

/// A change to the tensors of a whole file: name, type, shape and bytes.
type Change = fn(&mut Vec<(String, safetensors::Dtype, Vec<usize>, Vec<u8>)>);

/// The file with changed tensors.
fn rewritten(bytes: &[u8], change: Change) -> Vec<u8> {
    let tensors = SafeTensors::deserialize(bytes).unwrap();
    let (_, header) = SafeTensors::read_metadata(bytes).unwrap();
    let owned = tensors.tensors().into_iter().map(|(name, view)| {
        let (dtype, shape) = (view.dtype(), view.shape().to_vec());
        (name, dtype, shape, view.data().to_vec())
    });
    let mut owned: Vec<_> = owned.collect();
    change(&mut owned);
    let views = owned.iter().map(|(name, dtype, shape, data)| {
        let view = safetensors::tensor::TensorView::new(*dtype, shape.clone(), data);
        (name.as_str(), view.unwrap())
    });
    safetensors::serialize(views, header.metadata().clone()).unwrap()
}

#[test]
fn every_number_format_is_checked_at_load() {
    const UP: &str = "seq.layers.1.ff.up.weight";
    let cases: [(Dtype, Change, &[&str]); 8] = [
        (Dtype::F32, |t| t.retain(|t| t.0 != UP), &["is missing", "[64, 32]"]),
        (Dtype::Q8_0, |t| t.retain(|t| t.0 != UP), &["is missing", "[64, 32]"]),
        (Dtype::Q8_0, |t| t.retain(|t| t.0 != UP.to_owned() + ".scale"), &[".scale", "[64, 1]"]),
        (Dtype::Q6, |t| t.retain(|t| t.0 != UP.to_owned() + ".scale"), &[".scale", "[64, 1]"]),
        (
            Dtype::Q4_0,
            |t| {
                let up = t.iter_mut().find(|t| t.0 == UP).unwrap();
                up.2 = vec![32, 32];
            },
            &["[32, 32]", "[64, 16]"],
        ),
        (
            Dtype::Q4_0,
            |t| {
                let scale = t.iter_mut().find(|t| t.0.starts_with(UP) && t.0 != UP).unwrap();
                scale.3[..2].copy_from_slice(&half::f16::NAN.to_le_bytes());
            },
            &["not finite"],
        ),
        (
            Dtype::F16,
            |t| {
                let up = t.iter_mut().find(|t| t.0 == UP).unwrap();
                up.3[6..8].copy_from_slice(&half::f16::INFINITY.to_le_bytes());
            },
            &["not finite", "index 3"],
        ),
        (
            Dtype::F32,
            |t| {
                let up = t.iter_mut().find(|t| t.0 == UP).unwrap();
                (up.1, up.2) = (safetensors::Dtype::F64, vec![32, 32]);
            },
            &["[32, 32]", "[64, 32]"],
        ),
    ];
    for (dtype, change, words) in cases {
        let bytes = rewritten(&convert(TINY, "tiny", dtype, Keep::Everything).unwrap(), change);
        let text = Generator::from_bytes(&bytes, "broken").unwrap_err().to_string();
        for word in words.iter().chain(&[UP, "broken"]) {
            assert!(text.contains(word), "{dtype}: {text} lacks {word}");
        }
        assert!(!text.contains('\n'), "{text}");
    }
}

#[test]
fn another_preset_than_asked_is_refused() {
    let weights = Weights::open(TINY, "mine").unwrap();
    assert!(weights.expect_preset("tiny").is_ok());
    let text = weights.expect_preset("paper").unwrap_err().to_string();
    assert!(text.contains("mine") && text.contains("preset is `tiny`, expected `paper`"), "{text}");
}
