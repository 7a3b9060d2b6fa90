//! `servodance evaluate`.

use super::options::engine::{EngineArgs, SamplingArgs};
use servodance_runtime::process::console::stdout_line;
use servodance_runtime::process::progress::Progress;
use servodance_training::evaluate::{EvaluationRequest, evaluate};
use std::path::PathBuf;
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  servodance evaluate
      against fresh choreography: needs no data, some minutes
  servodance evaluate --data data.safetensors --json > figures.json
      against the held-out dance of a training file (see model/MODEL_CARD.md)
  servodance evaluate --data data.safetensors --minutes 20 --guidance 2
      with a dance of 20 minutes, the music counting more
  servodance evaluate --model mine.safetensors --style salsa --repeats 5
      weights of your own, quickly
  servodance evaluate --texts HumanML3D --extractors t2m
      R-Precision and MM-Dist as well, with files of your own (docs/metrics.md)";

/// What `evaluate` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
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
    #[arg(long, default_value_t = 20, value_name = "N")]
    pub repeats: usize,
    /// Clips of music danced to in each repeat.
    #[arg(long, default_value_t = 8, value_name = "N")]
    pub clips: usize,
    /// Seconds danced to each clip.
    #[arg(long, default_value_t = 20.0, value_name = "SECONDS")]
    pub seconds: f64,
    /// Also dance so many minutes in one go: does it die down, drift, jitter?
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub minutes: usize,
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

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let progress = Progress::share("evaluating", args.json);
    let found = evaluate(
        &EvaluationRequest {
            data: args.data,
            model: args.model,
            encodec: args.encodec,
            texts: args.texts,
            extractors: args.extractors,
            style: args.style,
            repeats: args.repeats,
            clips: args.clips,
            seconds: args.seconds,
            minutes: args.minutes,
            sampling: args.sampling.options(),
            engine: args.engine.options(),
            seed: args.seed,
        },
        |share| progress.at(100.0 * share),
    )?;
    progress.done();
    if args.json {
        stdout_line!("{}", serde_json::to_string_pretty(&found)?);
    } else {
        servodance_runtime::process::console::stdout(format_args!("{}", found.table()));
    }
    Ok(ExitCode::SUCCESS)
}
