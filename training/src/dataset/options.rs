//! What a training file is built from, and what came out.

use std::collections::BTreeMap;
use std::path::PathBuf;

use servodance_model::conditioning::Encodec;

/// What a training file is built from.
#[derive(Clone, Debug)]
#[allow(missing_docs)] // explained by `servodance dataset build --help`
pub struct DatasetOptions {
    /// A folder with `index.csv` and npz clips, as `dataset import` writes it; without
    /// it the file holds choreography alone.
    pub motion: Option<PathBuf>,
    pub out: PathBuf,
    /// How many songs every captured dance with a beat gets.
    pub songs_per_clip: usize,
    pub choreography_minutes: f64,
    pub seed: u64,
    /// Writes Encodec latents of all music as well.
    pub encodec: Option<Encodec>,
}

/// What was built: minutes by kind, and what was left out.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct DatasetSummary {
    /// Clips in the training file.
    pub clips: usize,
    /// Minutes written, by `source / style / split / music or not`.
    pub minutes: BTreeMap<String, f64>,
    /// Minutes of captured dance before copies, and those with a usable beat.
    pub captured_dance_minutes: f64,
    /// Of these, how many have a beat that music was rendered on.
    pub captured_dance_with_beat_minutes: f64,
    /// The terms of every source of captured motion.
    pub terms: BTreeMap<String, String>,
    /// Files that could not be read, with the reason.
    pub left_out: Vec<String>,
}
