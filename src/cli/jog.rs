//! `servodance jog`.

use crate::cli::prelude::*;
use servodance_runtime::bus_tools::jog::{Jog, JogStep};
use std::sync::atomic::Ordering;

const EXAMPLES: &str = include_str!("examples/jog.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[arg(help = "The joint", value_name = "JOINT")]
    pub joint: String,
    /// A built-in robot (see `servodance robots`) or a robot file.
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub robot: String,
    /// Where its servos are: serial:PATH, can:IFACE, slcan:PATH.
    #[arg(long, value_name = "BUS", required = true)]
    pub bus: Vec<String>,
    /// Move by this much, degrees, and end.
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true)]
    pub by: Option<f64>,
    /// Move to this angle, degrees, and end.
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true, conflicts_with = "by")]
    pub to: Option<f64>,
    /// How fast, degrees a second.
    #[arg(long, value_name = "DEGREES_A_SECOND", default_value_t = 20.0)]
    pub speed: f64,
    #[arg(help = "Do not ask", long)]
    pub yes: bool,
}

/// Moves the joint inside its limits; torque is off in the end.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let robot = Robot::load(&args.robot)?;
    let step = match (args.by, args.to) {
        (Some(degrees), _) => Some(JogStep::parse(&degrees.to_string())?),
        (None, Some(degrees)) => Some(JogStep::parse(&format!("={degrees}"))?),
        (None, None) => None,
    };
    let stop = motor_stop_signal()?;
    let jog =
        Jog { robot: &robot, joint: &args.joint, ports: &args.bus, step, speed_deg_s: args.speed };
    let moved = jog.run(Consent::from_flag(args.yes), &stop)?;
    stdout_line!("{moved}");
    if stop.load(Ordering::Acquire) {
        return Ok(ExitCode::from(INTERRUPTED));
    }
    Ok(ExitCode::SUCCESS)
}
