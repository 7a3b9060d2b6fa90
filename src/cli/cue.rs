//! `servodance cue`.

use super::options::stage::{RoleArgs, StageNetworkArgs};
use std::process::ExitCode;

const EXAMPLES: &str = include_str!("examples/cue.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Name of the follower; `all`: everybody.
    #[arg(value_name = "FOLLOWER")]
    pub follower: String,
    #[command(flatten)]
    pub role: RoleArgs,
    #[command(flatten)]
    pub place: StageNetworkArgs,
}

#[cfg(not(feature = "stage"))]
pub fn run(_: Args) -> anyhow::Result<ExitCode> {
    super::options::stage::not_built_in("cue")
}

#[cfg(feature = "stage")]
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let place = args.place.place(false, Vec::new());
    servodance_runtime::stage::cue(&place, &args.place.stage, &args.follower, args.role.role())?;
    Ok(ExitCode::SUCCESS)
}
