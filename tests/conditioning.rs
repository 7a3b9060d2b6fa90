//! Weights that hear Encodec, styles in words: what is needed beside the
//! weights, and what is refused.

use crate::program::Program;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use serde_json::{Value, json};
use servodance_audio::MusicAnalyzer;
use servodance_model::conditioning::{Encodec, HeardFrame};
use servodance_model::motion::Clip;
use servodance_runtime::pipeline::feature_extractor::FeatureExtractor;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

const TINY: &[u8] = include_bytes!("../model/src/tests/golden/tiny.safetensors");
const ENCODEC: &[u8] = include_bytes!("../model/src/conditioning/golden/encodec.safetensors");

pub fn metadata(bytes: &[u8]) -> HashMap<String, String> {
    let (_, header) = SafeTensors::read_metadata(bytes).expect("a header");
    header.metadata().clone().expect("metadata")
}

/// Numbers without a pattern, from -1 to 1.
fn noise(seed: usize, count: usize) -> impl Iterator<Item = f32> {
    let mut state = seed as u32 | 1;
    (0..count).map(move |_| {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state as i32 as f32 / 2_147_483_648.0
    })
}

pub fn write(
    path: &Path,
    tensors: &[(String, Vec<usize>, Vec<u8>)],
    meta: HashMap<String, String>,
) {
    let views = tensors.iter().map(|(name, shape, bytes)| {
        let dtype = match name.starts_with("start.") {
            true => Dtype::I32,
            false => Dtype::F32,
        };
        let view = TensorView::new(dtype, shape.clone(), bytes).expect("a tensor");
        (name.as_str(), view)
    });
    safetensors::serialize_to_file(views, Some(meta), path).expect("a file");
}

pub fn random(seed: usize, shape: &[usize], base: f32, scale: f32) -> Vec<u8> {
    let numbers = noise(seed, shape.iter().product());
    numbers.flat_map(|v| (base + scale * v).to_le_bytes()).collect()
}

/// The tiny random model as one that hears Encodec and takes CLIP's styles.
fn write_model(path: &Path, change: impl Fn(&mut Value)) {
    let mut meta = metadata(TINY);
    let mut config: Value = serde_json::from_str(&meta["config"]).expect("JSON");
    config["music"] = json!("encodec128");
    config["music_dim"] = json!(128);
    config["seq"]["style_dim"] = json!(512);
    change(&mut config);
    meta.insert("config".into(), config.to_string());
    let wide = |name: &str, shape: &[usize]| -> Vec<usize> {
        let mut shape = shape.to_vec();
        if let Some(last) = shape.last_mut() {
            match name {
                "norm.music_mean" | "norm.music_std" | "seq.music_in.weight" => *last = 128,
                "seq.style.weight" => *last = 512,
                _ if name.ends_with("style.scale.weight") => *last = 512,
                _ => {}
            }
        }
        shape
    };
    let tensors = SafeTensors::deserialize(TINY).expect("the tiny model");
    let tensors: Vec<_> = tensors
        .iter()
        .enumerate()
        .map(|(seed, (name, view))| {
            let shape = wide(name, view.shape());
            let bytes = match shape == view.shape() {
                true => view.data().to_vec(),
                false => random(seed + 1, &shape, f32::from(name == "norm.music_std"), 0.3),
            };
            (name.to_owned(), shape, bytes)
        })
        .collect();
    write(path, &tensors, meta);
}

/// Random numbers in the layout of `facebook/encodec_24khz`.
pub fn write_encodec(path: &Path) {
    type Entry = (Vec<usize>, f32, f32);
    let manifest: BTreeMap<String, Entry> =
        serde_json::from_str(&metadata(ENCODEC)["weights"]).expect("a manifest");
    let tensors: Vec<_> = manifest
        .into_iter()
        .enumerate()
        .map(|(seed, (name, (shape, base, scale)))| {
            let bytes = random(seed + 1, &shape, base, scale);
            (name, shape, bytes)
        })
        .collect();
    write(path, &tensors, HashMap::new());
}

fn program() -> Program {
    let program = Program::new();
    program.click_track("clicks.wav", 2.0, 120.0);
    write_model(&program.path("mine.safetensors"), |_| {});
    program
}

const GENERATE: [&str; 6] =
    ["generate", "clicks.wav", "--model", "mine.safetensors", "--out", "a.npz"];

fn with<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&GENERATE[..], more].concat()
}

#[test]
fn weights_that_hear_encodec_dance_with_its_file() {
    let program = program();
    write_encodec(&program.path("encodec.safetensors"));
    program.succeed(&with(&["--encodec", "encodec.safetensors"]));
    let first = Clip::read_npz(program.path("a.npz")).unwrap();
    assert!((39..=41).contains(&first.poses.len()), "{}", first.poses.len());
    // The same file where it is looked for.
    let folder = program.path("data/servodance/encodec_24khz");
    std::fs::create_dir_all(&folder).unwrap();
    let (from, to) = (program.path("encodec.safetensors"), folder.join("model.safetensors"));
    std::fs::rename(from, to).unwrap();
    let mut command = program.command(&GENERATE);
    let data = command.env("XDG_DATA_HOME", program.path("data"));
    assert!(data.status().expect("it runs").success());
    let again = Clip::read_npz(program.path("a.npz")).unwrap();
    assert_eq!(first.poses, again.poses);
    let output = program
        .command(&["dance", "clicks.wav", "--robot", "neck", "--no-picture"])
        .args(["--model", "mine.safetensors"])
        .env("XDG_DATA_HOME", program.path("data"))
        .output()
        .expect("it runs");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{told}");
}

#[test]
fn a_missing_or_wrong_encodec_is_told_in_one_line() {
    let program = program();
    let needed = "model.safetensors of facebook/encodec_24khz";
    let missing = with(&["--encodec", "none.safetensors"]);
    program.refused(&missing, &["none.safetensors", "No such file", needed]);
    // The tiny model is a safetensors file, but no Encodec.
    let other = with(&["--encodec", "mine.safetensors"]);
    program.refused(&other, &["encoder.layers.0.conv.bias", "[32]", needed]);
    std::fs::write(program.path("torn.safetensors"), &ENCODEC[..5000]).unwrap();
    program.refused(&with(&["--encodec", "torn.safetensors"]), &["torn", "whole"]);
    let mut command = program.command(&GENERATE);
    let nowhere = command.env("XDG_DATA_HOME", program.path("data"));
    let told = nowhere.output().expect("it runs").stderr;
    let told = String::from_utf8_lossy(&told).into_owned();
    assert!(told.contains("data/servodance/encodec_24khz/model.safetensors"), "{told}");
}

#[test]
fn another_feature_kind_is_refused() {
    let program = program();
    let built_in = ["generate", "clicks.wav", "--encodec", "x", "--out", "a.npz"];
    program.refused(&built_in, &["servodance39", "encodec128"]);
    let evaluate = ["evaluate", "--encodec", "mine.safetensors"];
    program.refused(&evaluate, &["servodance39", "encodec128"]);
    let doctor = ["doctor", "--model", "mine.safetensors", "--encodec", "none"];
    program.refused(&doctor, &["none", "facebook/encodec_24khz"]);
    write_model(&program.path("odd.safetensors"), |config| {
        config["music"] = json!("librosa35");
    });
    let odd = ["generate", "clicks.wav", "--model", "odd.safetensors", "--out", "a.npz"];
    program.refused(&odd, &["music_dim is 128, expected 35", "librosa35"]);
    write_model(&program.path("odd.safetensors"), |config| {
        config["music"] = json!("whale song");
    });
    program.refused(&odd, &["whale song", "servodance39", "librosa35", "encodec128"]);
}

#[test]
fn a_style_in_words_needs_weights_and_files_for_it() {
    let program = program();
    let built_in = ["generate", "clicks.wav", "--style-text", "slow", "--out", "a.npz"];
    program.refused(&built_in, &["64", "512", "salsa"]);
    write_encodec(&program.path("encodec.safetensors"));
    let encodec = ["--encodec", "encodec.safetensors", "--style-text", "slow"];
    let missing = [&encodec[..], &["--clip", "nowhere"]].concat();
    program.refused(&with(&missing), &["nowhere/tokenizer.json", "openai/clip-vit-base-patch32"]);
    std::fs::create_dir(program.path("clip")).unwrap();
    let tokenizer = include_str!("../model/src/conditioning/golden/tokenizer.json");
    std::fs::write(program.path("clip/tokenizer.json"), tokenizer).unwrap();
    let half = [&encodec[..], &["--clip", "clip"]].concat();
    program.refused(&with(&half), &["clip/model.safetensors"]);
    std::fs::write(program.path("clip/model.safetensors"), TINY).unwrap();
    program.refused(&with(&half), &["token_embedding", "[49408, 512]"]);
}

fn hear(encodec: &Encodec, samples: &[f32], block: usize) -> Vec<HeardFrame> {
    let rate_hz = 48_000;
    let analyzer = MusicAnalyzer::new(rate_hz).unwrap();
    let mut ears = FeatureExtractor::new(analyzer, rate_hz, Some(encodec)).unwrap();
    let mut heard = Vec::new();
    for block in samples.chunks(block) {
        ears.push(block).unwrap();
        heard.extend(std::iter::from_fn(|| ears.pop()));
    }
    heard
}

#[test]
fn latents_come_with_their_frame_and_know_nothing_of_the_next() {
    let program = Program::new();
    write_encodec(&program.path("encodec.safetensors"));
    let encodec = Encodec::load(&program.path("encodec.safetensors")).unwrap();
    let sound: Vec<f32> = noise(5, 48_000).map(|v| 0.3 * v).collect();
    let heard = hear(&encodec, &sound, 480);
    assert!((20..=21).contains(&heard.len()), "{}", heard.len());
    assert!(heard.iter().all(|h| h.latent.is_some()));
    assert_eq!(heard, hear(&encodec, &sound, 10_000));
    // Silence from 0.5 s on: frames up to then are the same, later ones not.
    let mut cut = sound.clone();
    cut[24_000..].fill(0.0);
    let other = hear(&encodec, &cut, 480);
    assert_eq!(heard[..=10], other[..=10]);
    assert_ne!(heard[12].latent, other[12].latent);
    // In time: a frame is there within 3 ms of sound after its moment.
    let soon = hear(&encodec, &sound[..24_000 + 144], 48);
    assert!(soon.len() >= 11, "{}", soon.len());
}
