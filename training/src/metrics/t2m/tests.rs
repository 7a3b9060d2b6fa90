//! The extractors against PyTorch, and folders that are refused.

use super::*;
use crate::golden::{Golden, Manifest, check_same, noise, write_checkpoint};

const TOLERANCE: f32 = 1e-4;

fn golden() -> Golden {
    Golden::open(include_bytes!("golden/t2m.safetensors"))
}

/// A user's folder with the golden file's weights, changed somehow.
fn folder(change: impl Fn(&mut Manifest, &mut serde_json::Value)) -> tempfile::TempDir {
    let golden = golden();
    let mut list = serde_json::json!({
        "words": golden.json::<Vec<String>>("words"),
        "kinds": golden.json::<Vec<String>>("kinds"),
        "kind_of": golden.json::<serde_json::Value>("kind_of"),
    });
    let mut manifest = golden.weights();
    change(&mut manifest, &mut list);
    let folder = tempfile::tempdir().unwrap();
    write_checkpoint(&folder.path().join("model.safetensors"), &manifest);
    std::fs::write(folder.path().join("words.json"), list.to_string()).unwrap();
    folder
}

fn refused(folder: &Path) -> String {
    Extractors::load(folder).unwrap_err().to_string()
}

#[test]
fn points_agree_with_pytorch() {
    let (golden, folder) = (golden(), folder(|_, _| {}));
    let extractors = Extractors::load(folder.path()).unwrap();
    let frames: Vec<usize> = golden.json("frames");
    let motion = |(i, frames): (usize, &usize)| -> Vec<HumanMlVector> {
        let numbers: Vec<f32> = noise(&format!("motion {i}"), frames * HUMANML_DIM).collect();
        numbers.as_chunks::<HUMANML_DIM>().0.to_vec()
    };
    let motions: Vec<Vec<HumanMlVector>> = frames.iter().enumerate().map(motion).collect();
    let views: Vec<&[HumanMlVector]> = motions.iter().map(Vec::as_slice).collect();
    let found = extractors.motions(&views).unwrap().concat();
    check_same("motions", &found, &golden.floats("motions"), TOLERANCE);
    // Alone as in company.
    let alone = extractors.motions(&views[..1]).unwrap().concat();
    check_same("alone", &alone, &found[..POINT_DIM], 1e-5);

    let texts: Vec<String> = golden.json("texts");
    let tokens: Vec<Vec<&str>> = texts.iter().map(|t| t.split(' ').collect()).collect();
    let tokens: Vec<Vec<&str>> = tokens
        .into_iter()
        .map(|t| t.into_iter().filter(|token| !token.is_empty()).collect())
        .collect();
    let views: Vec<&[&str]> = tokens.iter().map(Vec::as_slice).collect();
    let found = extractors.texts(&views).unwrap().concat();
    check_same("texts", &found, &golden.floats("texts"), TOLERANCE);

    let short = extractors.motions(&[&motions[0][..3]]).unwrap_err();
    assert!(short.to_string().contains("3 frames"), "{short}");
}

#[test]
fn every_missing_file_is_named() {
    for name in ["model.safetensors", "words.json"] {
        let folder = folder(|_, _| {});
        std::fs::remove_file(folder.path().join(name)).unwrap();
        let text = refused(folder.path());
        assert!(text.contains(name) && text.contains("No such file"), "{text}");
    }
}

#[test]
fn another_layout_is_refused_by_name() {
    let lost = folder(|weights, _| drop(weights.remove("motion_encoder.hidden")));
    let text = refused(lost.path());
    assert!(text.contains("motion_encoder.hidden"), "{text}");
    let shorter = folder(|_, list| drop(list["words"].as_array_mut().unwrap().pop()));
    let text = refused(shorter.path());
    assert!(text.contains("words.weight") && text.contains("[9, 300]"), "{text}");
    for (key, value, told) in [
        ("words", serde_json::json!("all"), "words.json"),
        ("kinds", serde_json::json!(["NOUN"]), "expected 15"),
        ("kind_of", serde_json::json!({ "walk": "GAIT" }), "GAIT"),
    ] {
        let odd = folder(|_, list| list[key] = value.clone());
        let text = refused(odd.path());
        assert!(text.contains(told), "{text}");
    }
}
