//! `servodance evaluate`.

use crate::cli::prelude::*;
use servodance_training::evaluate::{EvaluationRequest, evaluate};

const EXAMPLES: &str = include_str!("examples/evaluate.txt").trim_ascii_end();

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
        stdout(format_args!("{}", found.table()));
    }
    Ok(ExitCode::SUCCESS)
}
