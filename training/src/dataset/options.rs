//! What a training file is built from, and what came out.

use super::feature_args::FeatureArgs;
use servodance_runtime::process::number_range::within;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::PathBuf;

/// How much of each kind can be asked for.
const MINUTES: RangeInclusive<f64> = 0.0..=10_000.0;

/// What a training file is built from.
#[derive(Clone, Debug, clap::Args)]
pub struct DatasetOptions {
    /// The file to write.
    #[arg(value_name = "FILE.safetensors")]
    pub out: PathBuf,
    /// A folder that `dataset import` wrote; choreography alone if left out.
    #[arg(long, value_name = "DIR")]
    pub motion: Option<PathBuf>,
    /// Songs for every captured dance with a beat.
    #[arg(long, default_value_t = 4, value_name = "N")]
    pub songs: usize,
    /// Minutes of dances to songs with sections, made of figures of the captured dance.
    #[arg(long, default_value_t = 0.0, value_name = "MINUTES", value_parser = within(MINUTES))]
    pub figures: f64,
    /// Minutes of captured motion turned over, down to upside down: for stage 1.
    #[arg(long, default_value_t = 0.0, value_name = "MINUTES", value_parser = within(MINUTES))]
    pub tilted: f64,
    /// Minutes of choreography by rules.
    #[arg(long, default_value_t = 90.0, value_name = "MINUTES", value_parser = within(MINUTES))]
    pub choreography: f64,
    /// Which features of the music are written.
    #[command(flatten)]
    pub features: FeatureArgs,
    /// Everything random follows from it.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// No progress bar
    #[arg(long, short)]
    pub quiet: bool,
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
