//! `servodance schema`.

use clap::ValueEnum;
use servodance_runtime::robot::ROBOT_SCHEMA;
use std::process::ExitCode;

const EXAMPLES: &str = include_str!("examples/schema.txt").trim_ascii_end();

/// What `schema` is asked for.
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
        Of::Robot => servodance_runtime::process::console::stdout(format_args!("{ROBOT_SCHEMA}")),
    }
    Ok(ExitCode::SUCCESS)
}
