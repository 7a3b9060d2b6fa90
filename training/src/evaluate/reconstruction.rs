//! What the VQ-VAE makes of the held-out clips.

use super::figures;
use servodance_model::motion::{Clip, Pose, mpjpe_m};
use servodance_model::{Codec, Generator};

pub(super) struct CodeUsage {
    pub mpjpe_mm: Vec<f64>,
    pub used: Vec<f64>,
}

pub(super) fn codes(
    codec: &Codec,
    real: &[Vec<Pose>],
    generator: &Generator,
) -> anyhow::Result<CodeUsage> {
    let config = generator.config();
    let mut seen = vec![vec![false; config.codes]; config.codes_a_frame()];
    let mut mpjpe_mm = Vec::new();
    for poses in real {
        let original = Clip::of_frames(poses.clone());
        let codes = codec.encode(&original)?;
        for row in &codes {
            for (seen, code) in seen.iter_mut().zip(row) {
                seen[*code] = true;
            }
        }
        let back = codec.decode("", &codes)?;
        let original = original.normalised().poses;
        let windows = original.chunks(figures::WINDOW_FRAMES);
        let pairs = windows.zip(back.poses.chunks(figures::WINDOW_FRAMES));
        mpjpe_mm.extend(pairs.filter_map(|(a, b)| mpjpe_m(a, b)).map(|m| 1e3 * m));
    }
    let share = |seen: &Vec<bool>| seen.iter().filter(|s| **s).count() as f64 / seen.len() as f64;
    Ok(CodeUsage { mpjpe_mm, used: seen.iter().map(share).collect() })
}
