//! Motion without music as one training file:
//! `cargo run --release -p servodance-model --example motion_dataset -- DIR OUT.safetensors`
//!
//! Reads `DIR/index.csv` and its clips, leaves out motion off the flat floor,
//! brings all to one skeleton, adds mirrored copies and splits by take.

use std::path::Path;
use std::process::ExitCode;

use servodance_model::motion::{Clip, MotionError, encode};
use servodance_training::motion::corpus::{self, CorpusClip};
use servodance_training::motion::index;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [folder, out] = &args[..] else {
        eprintln!("usage: motion_dataset DIR OUT.safetensors");
        return ExitCode::from(2);
    };
    match build(Path::new(folder), Path::new(out)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn build(folder: &Path, out: &Path) -> Result<(), MotionError> {
    let mut clips = Vec::new();
    let mut minutes = [0.0; 3];
    for entry in index::read(folder)? {
        let original = match Clip::read_npz(entry.path(folder)) {
            Ok(clip) => clip,
            Err(error) => {
                eprintln!("left out: {error}");
                continue;
            }
        };
        minutes[entry.split as usize] += entry.minutes;
        let copies = [(original.clone(), ""), (original.mirrored(), "#mirrored")];
        for (variant, (clip, suffix)) in copies.into_iter().enumerate() {
            clips.push(CorpusClip {
                name: format!("{}{suffix}", entry.name),
                motion: encode(&clip.normalised().poses),
                music: None,
                latents: None,
                style: entry.style(),
                split: entry.split,
                dance: entry.dance,
                synthetic: false,
                variant,
            });
        }
    }
    let [train, validation, test] = minutes;
    let recipe = serde_json::json!({
        "what": "captured motion without music, original and mirrored",
        "minutes": { "train": train, "validation": validation, "test": test },
    });
    corpus::write(out, &clips, &recipe)?;
    println!(
        "{} clips, {train:.1} minutes to train, {validation:.1} to validate, {test:.1} to test (before mirroring)",
        clips.len()
    );
    Ok(())
}
