//! `servodance completions`.

use super::Cli;
use crate::cli::prelude::*;
use clap::CommandFactory;
use clap_complete::Shell;

const EXAMPLES: &str = include_str!("examples/completions.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The shell to complete commands in.
    pub shell: Shell,
}

/// Prints the script to standard output.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "servodance", &mut script);
    stdout(format_args!("{}", String::from_utf8_lossy(&script)));
    Ok(ExitCode::SUCCESS)
}
