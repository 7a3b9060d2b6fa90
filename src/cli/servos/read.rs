//! `servodance servos read`.

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
    /// Registers, such as present_position; all of them if none is named.
    #[arg(value_name = "REGISTER")]
    pub registers: Vec<String>,
}

/// Prints a line for each register.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let place = args.places.open()?.one(&args.id)?;
    let say = |line: &str| stdout_line!("{line}");
    memory::read(&place, &args.registers, say, |note| stderr_line!("{note}"))?;
    Ok(ExitCode::SUCCESS)
}
