//! `servodance robot setup`.

use crate::cli::prelude::*;
use servodance_runtime::bus_tools::setup::{NextServo, set_up};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// A built-in robot (see `servodance robots`) or a robot file.
    #[arg(value_name = "NAME|FILE.toml")]
    pub robot: String,
    /// Where its servos are connected: serial:PATH, or a CAN port such as slcan:PATH or
    /// can:IFACE; NAME=... for each bus of a robot with several.
    #[arg(long, value_name = "BUS", required = true)]
    pub bus: Vec<String>,
    /// Do not ask: take each new servo as soon as it answers.
    #[arg(long)]
    pub yes: bool,
}

/// Asks for one servo after the other; prints what became of each.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let robot = Robot::load(&args.robot)?;
    let next = match args.yes {
        true => NextServo::Awaited,
        false => NextServo::Asked,
    };
    set_up(&robot, &args.bus, next, |line| stdout_line!("{line}"), |note| stderr_line!("{note}"))?;
    Ok(ExitCode::SUCCESS)
}
