//! Captured dance to compare with.

use crate::dataset::index;
use anyhow::ensure;
use servodance_model::motion::Clip;
use servodance_types::FRAME_RATE_HZ;
use std::path::Path;

/// Shorter clips are left out, seconds.
const SHORTEST_S: f64 = 10.0;

/// The captured dances of a folder that `dataset import` wrote, on the common skeleton, at
/// most so long. Fails where there is none.
pub fn captured_dances(folder: &Path, seconds: f64) -> anyhow::Result<Vec<Clip>> {
    let mut clips = Vec::new();
    for entry in index::read(folder)?.iter().filter(|entry| entry.dance) {
        let mut clip = Clip::read_npz(entry.path(folder))?.normalised();
        if clip.duration_s() < SHORTEST_S {
            continue;
        }
        clip.poses.truncate((seconds * FRAME_RATE_HZ) as usize);
        clip.name = entry.name.clone();
        clips.push(clip);
    }
    ensure!(!clips.is_empty(), "{} holds no dance of at least {SHORTEST_S} s", folder.display());
    Ok(clips)
}
