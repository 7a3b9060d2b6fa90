//! `servodance bench bus`.

use crate::cli::prelude::*;
use servodance_lab::bench::bus as bench;
use servodance_runtime::bus_tools::sim_link::LinkChoice;

const EXAMPLES: &str = include_str!("../examples/bench-bus.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A built-in robot, or a robot file.
    #[arg(long, default_value = "op3", value_name = "NAME|FILE.toml")]
    pub robot: String,
    /// Bits a second, instead of the robot file's.
    #[arg(long, value_name = "BAUD")]
    pub baud: Option<u32>,
    /// What is between driver and simulated servos: a socket (unix), which is quick, or
    /// the kernel's pseudo-terminal (pty, slcan), whose own time it then measures as well.
    #[arg(long, value_enum, default_value_t = LinkChoice::Unix, value_name = "LINK")]
    pub link: LinkChoice,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let robot = Robot::load(&args.robot)?;
    let figures = bench::run(&robot, args.baud, args.link)?;
    if args.json {
        stdout_line!("{}", serde_json::to_string(&figures)?);
    } else {
        stdout(format_args!("{figures}"));
    }
    Ok(ExitCode::SUCCESS)
}
