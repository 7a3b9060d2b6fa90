//! Weights of one file with the VQ-VAE of another: codes that were trained further, danced by a
//! MotionSeq that knew them before.

use std::collections::BTreeMap;

use safetensors::tensor::SafeTensors;

use super::Weights;
use super::tensor_file::{self, Entry};
use crate::error::ModelError;

/// Tensors of stage 1.
const STAGE_ONE: [&str; 2] = ["vq.", "norm.motion_"];

/// The bytes of `weights` with stage 1 of `stage_one`; each is a file's bytes and its name in
/// errors. Both must have the same tensors in the same number format. The provenance says both.
pub fn with_stage_one(
    (weights, source): (&[u8], &str),
    (stage_one, stage_one_source): (&[u8], &str),
) -> Result<Vec<u8>, ModelError> {
    let own = Weights::open(weights, source)?.provenance().to_owned();
    let given = Weights::open(stage_one, stage_one_source)?.provenance().to_owned();
    let file = |reason: String| ModelError::File { source_name: stage_one_source.into(), reason };
    let unread = |e: safetensors::SafeTensorError| file(e.to_string());
    let two = SafeTensors::deserialize(weights).map_err(unread)?;
    let one = SafeTensors::deserialize(stage_one).map_err(unread)?;
    let mut views = two.tensors();
    let is_stage_one = |name: &str| STAGE_ONE.iter().any(|prefix| name.starts_with(prefix));
    for (name, view) in views.iter_mut().filter(|(name, _)| is_stage_one(name)) {
        let given = one.tensor(name).map_err(unread)?;
        if (given.shape(), given.dtype()) != (view.shape(), view.dtype()) {
            let [other, here] =
                [&given, &*view].map(|view| format!("{:?} {:?}", view.dtype(), view.shape()));
            return Err(file(format!(
                "{name} is {other}, in {source} {here}: bring both files to one --dtype first"
            )));
        }
        *view = given;
    }
    let entries = views.iter().map(|(name, view)| Entry {
        name,
        dtype: view.dtype(),
        shape: view.shape(),
        data: view.data(),
    });
    let (_, header) = SafeTensors::read_metadata(weights).map_err(unread)?;
    let mut metadata: BTreeMap<String, String> =
        header.metadata().clone().unwrap_or_default().into_iter().collect();
    metadata.insert("provenance".into(), both(&own, &given));
    Ok(tensor_file::bytes(&metadata, entries.collect()))
}

/// Where both came from, as one JSON object.
fn both(own: &str, stage_one: &str) -> String {
    let parsed = |text: &str| serde_json::from_str(text).unwrap_or(serde_json::json!(text));
    let mut both: serde_json::Value = parsed(own);
    match both.as_object_mut() {
        Some(object) => drop(object.insert("stage_one".into(), parsed(stage_one))),
        None => both = serde_json::json!({ "from": both, "stage_one": parsed(stage_one) }),
    }
    both.to_string()
}

#[cfg(test)]
mod tests {
    use super::super::{BUILT_IN, Dtype, Keep, convert};
    use super::*;

    #[test]
    fn only_tensors_of_stage_one_are_exchanged_and_both_origins_are_said() {
        let own = convert(BUILT_IN, "built in", Dtype::F16, Keep::Dance).unwrap();
        let name = "vq.codebook.trunk";
        let mut other = own.clone();
        let changed = {
            let tensors = SafeTensors::deserialize(&own).unwrap();
            let start = tensors.tensor(name).unwrap().data().as_ptr() as usize;
            start - own.as_ptr() as usize
        };
        other[changed] ^= 1;
        let joined = with_stage_one((&own, "own"), (&other, "other")).unwrap();
        let [one, two, both] =
            [&own, &other, &joined].map(|bytes| SafeTensors::deserialize(bytes).unwrap());
        for (tensor, view) in both.tensors() {
            let from = if tensor.starts_with("vq.") { &two } else { &one };
            assert_eq!(view.data(), from.tensor(&tensor).unwrap().data(), "{tensor}");
        }
        assert_ne!(both.tensor(name).unwrap().data(), one.tensor(name).unwrap().data());
        let weights = Weights::open(&joined, "joined").unwrap();
        assert!(weights.provenance().contains("\"stage_one\":{"), "{}", weights.provenance());
        let error = with_stage_one((&own, "own"), (BUILT_IN, "built in")).unwrap_err();
        assert!(error.to_string().contains("--dtype"), "{error}");
    }
}
