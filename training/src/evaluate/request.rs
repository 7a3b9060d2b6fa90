//! What `servodance evaluate` is asked for.

use super::songs::SongArgs;
use servodance_model::GeneratorOptions;
use servodance_runtime::pipeline::model_args::{EngineArgs, SamplingArgs};
use servodance_runtime::process::number_range::within;
use std::path::PathBuf;

/// Which weights to evaluate, against which reference, how thoroughly.
#[derive(Clone, Debug, clap::Args)]
pub struct EvaluationRequest {
    /// A training file with held-out dance; fresh choreography if left out.
    #[arg(long, value_name = "FILE.safetensors")]
    pub data: Option<PathBuf>,
    /// Weights to use in place of the built-in ones.
    #[arg(long, value_name = "FILE.safetensors")]
    pub model: Option<PathBuf>,
    /// Encodec's model.safetensors, for weights that hear encodec128, if it is
    /// not in servodance/encodec_24khz in the user's data folder.
    #[arg(long, value_name = "FILE.safetensors")]
    pub encodec: Option<PathBuf>,
    /// HumanML3D's folder (new_joint_vecs, texts, test.txt): how well its motions
    /// are told by their texts, before and after the codes (docs/metrics.md).
    #[arg(long, value_name = "DIR")]
    pub texts: Option<PathBuf>,
    /// The folder with the T2M extractors for --texts (model.safetensors,
    /// words.json), if it is not servodance/t2m in the user's data folder.
    #[arg(long, value_name = "DIR", requires = "texts")]
    pub extractors: Option<PathBuf>,
    /// One style for all clips, in place of the style of each; an unknown one
    /// lists those that the model knows.
    #[arg(long, value_name = "NAME")]
    pub style: Option<String>,
    /// How often everything is danced anew.
    #[arg(long, default_value_t = 20, value_name = "N", value_parser = within(2..=1000_usize))]
    pub repeats: usize,
    /// Clips of music danced to in each repeat.
    #[arg(long, default_value_t = 8, value_name = "N", value_parser = within(2..=1000_usize))]
    pub clips: usize,
    /// Seconds danced to each clip or pair (20 if left out), or to each song (40).
    #[arg(long, value_name = "SECONDS", value_parser = within(10.0..=3600.0))]
    pub seconds: Option<f64>,
    /// Also dance so many minutes in one go: does it die down, drift, jitter?
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = within(0..=1000_usize))]
    pub minutes: usize,
    /// Songs in place of clips, and judging by eye.
    #[command(flatten)]
    pub by_song: SongArgs,
    /// How codes are drawn.
    #[command(flatten)]
    pub sampling: SamplingArgs,
    /// How the model's steps are computed.
    #[command(flatten)]
    pub engine: EngineArgs,
    /// Seed of the first repeat.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Print JSON in place of the table.
    #[arg(long)]
    pub json: bool,
}

impl EvaluationRequest {
    pub(super) fn seconds_of_clips(&self) -> f64 {
        self.seconds.unwrap_or(20.0)
    }

    pub(super) fn seconds_of_songs(&self) -> f64 {
        self.seconds.unwrap_or(40.0)
    }

    pub(super) fn options(&self, seed: u64) -> GeneratorOptions {
        GeneratorOptions { seed, style: self.style.clone(), ..self.sampling.options() }
    }
}
