//! `servodance man`.

use super::Cli;
use crate::cli::prelude::*;
use anyhow::Context;
use clap::CommandFactory;

const EXAMPLES: &str = include_str!("examples/man.txt").trim_ascii_end();

/// Where the pages go.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The folder to write to, one page a command; made if it is not there.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Writes a page for the program and one for each command.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let folder = &args.out;
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    clap_mangen::generate_to(Cli::command(), folder)
        .with_context(|| format!("cannot write the pages to {}", folder.display()))?;
    Ok(ExitCode::SUCCESS)
}
