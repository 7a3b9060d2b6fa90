//! `servodance sim-bus`.

use super::stop_signal;
use crate::bus_tools;
use crate::robot::Robot;
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  servodance sim-bus --robot op3
      the first line is the serial port to open; Ctrl-C or SIGTERM ends it
  servodance dance --bus serial:/dev/pts/7
      dance on it from another terminal, as on real servos";

/// What `sim-bus` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A built-in robot (see `servodance robots`) or a robot file.
    #[arg(long, default_value = "op3", value_name = "NAME|FILE.toml")]
    pub robot: String,
}

/// Serves until stopped.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let robot = Robot::load(&args.robot)?;
    let stop = stop_signal()?;
    let served = bus_tools::serve(&robot, &stop, |port| println!("{port}"))?;
    eprintln!("{served}");
    Ok(ExitCode::SUCCESS)
}
