//! `servodance schema`.

use crate::cli::prelude::*;
use clap::ValueEnum;
use servodance_runtime::robot::ROBOT_SCHEMA;

const EXAMPLES: &str = include_str!("examples/schema.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[arg(help = "Of which file", value_enum)]
    pub of: Of,
}

/// Files that have a schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Of {
    #[value(help = "The robot file")]
    Robot,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    match args.of {
        Of::Robot => stdout(format_args!("{ROBOT_SCHEMA}")),
    }
    Ok(ExitCode::SUCCESS)
}
