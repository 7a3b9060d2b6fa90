//! `servodance servos check`.

use crate::cli::prelude::*;
use servodance_runtime::bus_tools::servo_check;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// A built-in robot (see `servodance robots`) or a robot file.
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub robot: String,
    /// Where its servos are: serial:PATH; NAME=... for each bus of a robot with several.
    #[arg(long, value_name = "BUS", required = true)]
    pub bus: Vec<String>,
    /// Put right what can be; torque goes off.
    #[arg(long)]
    pub fix: bool,
    #[arg(help = "Do not ask", long)]
    pub yes: bool,
}

/// Prints a line for each deviation, and for each change.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let robot = Robot::load(&args.robot)?;
    let consent = Consent::from_flag(args.yes);
    let found = servo_check::check(&robot, &args.bus, args.fix, consent)?;
    for line in &found.lines {
        stdout_line!("{line}");
    }
    stdout_line!(
        "{} servos, {}",
        robot.servos.len(),
        match found.open {
            0 => "as they should be".to_owned(),
            open => format!("{open} settings not as they should be"),
        }
    );
    Ok(match found.open {
        0 => ExitCode::SUCCESS,
        _ => ExitCode::FAILURE,
    })
}
