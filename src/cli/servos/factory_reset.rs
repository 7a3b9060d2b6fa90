//! `servodance servos factory-reset`.

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
    /// Have it forget its id and rate as well.
    #[arg(long)]
    pub all: bool,
    /// Do it; without this what would be lost is shown, and nothing changed.
    #[arg(long)]
    pub yes: bool,
}

/// Prints what it would lose, or where it answers now.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let place = args.places.open()?.one(&args.id)?;
    memory::factory_reset(&place, args.all, args.yes, |line| stdout_line!("{line}"))?;
    Ok(ExitCode::SUCCESS)
}
