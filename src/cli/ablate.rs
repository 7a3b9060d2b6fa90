//! `servodance ablate`.

use crate::cli::prelude::*;
use servodance_training::ablate::{AblationRequest, ablate};

const EXAMPLES: &str = include_str!("examples/ablate.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    request: AblationRequest,
}

/// Trains, scores, prints the table.
pub fn run(Args { request }: Args) -> anyhow::Result<ExitCode> {
    let stop = stop_signal()?;
    let Some(table) = ablate(&request, &stop)? else {
        stderr_line!("stopped; the same command goes on from here");
        return Ok(ExitCode::from(INTERRUPTED));
    };
    stdout(format_args!("{}", table.text()));
    if !request.quiet {
        stdout_line!("\n{}", request.out.join("ablation.png").display());
    }
    Ok(ExitCode::SUCCESS)
}
