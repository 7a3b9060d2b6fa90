//! Plays a score through a soundfont with fluidsynth, a tool of the data's build.

use std::error::Error;
use std::path::Path;
use std::process::Command;

use super::RATE_HZ;
use super::score::Score;

/// Mono samples of a score, `duration_s` long.
pub fn play(
    score: &Score,
    font: &Path,
    duration_s: f64,
    wet: bool,
) -> Result<Vec<f32>, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let (midi, raw) = (folder.path().join("score.mid"), folder.path().join("sound.raw"));
    std::fs::write(&midi, score.midi())?;
    let wet = if wet { "1" } else { "0" };
    let mut synthesiser = Command::new("fluidsynth");
    synthesiser.args(["-niq", "-R", wet, "-C", wet, "-g", "0.4", "-r", &RATE_HZ.to_string()]);
    synthesiser.args(["-o", "synth.dynamic-sample-loading=1", "-T", "raw", "-O", "float", "-F"]);
    let status = synthesiser.arg(&raw).arg(font).arg(&midi).status()?;
    if !status.success() {
        return Err(format!("fluidsynth ended with {status}").into());
    }
    let bytes = std::fs::read(&raw)?;
    let value = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    let mono = bytes.chunks_exact(8).map(|b| 0.5 * (value(&b[..4]) + value(&b[4..])));
    let mut samples: Vec<f32> = mono.collect();
    samples.resize((duration_s * f64::from(RATE_HZ)).round() as usize, 0.0);
    Ok(samples)
}
