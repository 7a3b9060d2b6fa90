//! `servodance devices`.

use crate::cli::prelude::*;
use servodance_runtime::pipeline::microphone::input_table;

const EXAMPLES: &str = include_str!("examples/devices.txt").trim_ascii_end();

/// `devices` takes no arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {}

/// Prints one line an input.
pub fn run(_args: Args) -> anyhow::Result<ExitCode> {
    stdout(format_args!("{}", input_table()?));
    Ok(ExitCode::SUCCESS)
}
