//! `servodance servos write`.

use crate::cli::prelude::*;
use crate::cli::servos::PlacesArgs;
use servodance_runtime::bus_tools::memory;

#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub places: PlacesArgs,
    /// The servo: its id, or a joint of the robot.
    #[arg(long, value_name = "ID|JOINT")]
    pub id: String,
    /// What to write: a raw number, one with the register's unit, or one of its words, such
    /// as maximum_position_limit=90deg.
    #[arg(value_name = "REGISTER=VALUE", required = true)]
    pub settings: Vec<String>,
}

/// Prints a line for each register that was written.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let place = args.places.open()?.one(&args.id)?;
    memory::write(&place, &args.settings, |line| stdout_line!("{line}"))?;
    Ok(ExitCode::SUCCESS)
}
