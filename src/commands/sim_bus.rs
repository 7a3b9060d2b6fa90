//! `servodance sim-bus`.

use super::stop_signal;
use crate::bus_tools::serve;
use crate::robot::Robot;
use crate::sim_link::LinkChoice;
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  servodance sim-bus --robot op3
      the first line is the serial port to open; Ctrl-C or SIGTERM ends it
  servodance sim-bus --robot my-can-robot.toml --link udp
      motors on CAN for python-can's udp_multicast; the first line is GROUP:PORT
  servodance dance --bus serial:/dev/pts/7
      dance on it from another terminal, as on real servos";

/// What `sim-bus` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A built-in robot (see `servodance robots`) or a robot file.
    #[arg(long, default_value = "op3", value_name = "NAME|FILE.toml")]
    pub robot: String,
    /// What other programs open: a serial port (pty), a serial CAN adapter
    /// (slcan) or multicast (udp); pty or slcan if left out, as the robot's bus needs.
    #[arg(long, value_enum)]
    pub link: Option<LinkChoice>,
}

/// Serves until stopped.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let robot = Robot::load(&args.robot)?;
    let stop = stop_signal()?;
    let served = serve::serve(&robot, args.link, &stop, |port| println!("{port}"))?;
    eprintln!("{served}");
    Ok(ExitCode::SUCCESS)
}
