//! `servodance evaluate`.

use servodance_runtime::process::console::stdout_line;
use servodance_runtime::process::progress::Progress;
use servodance_training::evaluate::{EvaluationRequest, evaluate};
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
    #[command(flatten)]
    request: EvaluationRequest,
}

pub fn run(Args { request }: Args) -> anyhow::Result<ExitCode> {
    let progress = Progress::share("evaluating", request.json);
    let found = evaluate(&request, |share| progress.at(100.0 * share))?;
    progress.done();
    if request.json {
        stdout_line!("{}", serde_json::to_string_pretty(&found)?);
    } else {
        servodance_runtime::process::console::stdout(format_args!("{}", found.table()));
    }
    Ok(ExitCode::SUCCESS)
}
