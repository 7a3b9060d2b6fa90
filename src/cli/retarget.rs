//! `servodance retarget`.

use crate::cli::prelude::*;
use servodance_runtime::offline::retarget_motion::{self, RetargetRequest};
use servodance_training::motion::format::read_motion;

const EXAMPLES: &str = include_str!("examples/retarget.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    request: RetargetRequest,
}

/// Retargets and prints what came of it.
pub fn run(Args { request }: Args) -> anyhow::Result<ExitCode> {
    let lines = retarget_motion::retarget(&request, |path| Ok(read_motion(path)?))?;
    if !request.quiet {
        for line in lines {
            stdout_line!("{line}");
        }
    }
    Ok(ExitCode::SUCCESS)
}
