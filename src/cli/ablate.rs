//! `servodance ablate`.

use super::{INTERRUPTED, stop_signal};
use servodance_runtime::process::console::{stderr_line, stdout_line};
use servodance_training::ablate::{AblationRequest, ablate};
use std::process::ExitCode;

const EXAMPLES: &str = include_str!("examples/ablate.txt").trim_ascii_end();

/// What `ablate` is asked for.
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
    servodance_runtime::process::console::stdout(format_args!("{}", table.text()));
    if !request.quiet {
        stdout_line!("\n{}", request.out.join("ablation.png").display());
    }
    Ok(ExitCode::SUCCESS)
}
