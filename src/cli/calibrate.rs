//! `servodance calibrate`.

use crate::cli::prelude::*;
use servodance_runtime::bus_tools::calibrate::Calibration;

const EXAMPLES: &str = include_str!("examples/calibrate.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[arg(help = "The robot file", long, value_name = "FILE.toml")]
    pub robot: String,
    /// Where its servos are: serial:PATH, can:IFACE, slcan:PATH; NAME=... for each
    /// bus of a robot with several.
    #[arg(long, value_name = "BUS", required = true)]
    pub bus: Vec<String>,
    #[arg(help = "Find directions too", long)]
    pub directions: bool,
    /// Write here instead, beside the same URDF.
    #[arg(long, value_name = "FILE.toml")]
    pub output: Option<PathBuf>,
    /// Do not ask (Enter, or the end of standard input, still says when the pose is there).
    #[arg(long)]
    pub yes: bool,
}

/// Measures, shows, and writes.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let calibration = Calibration {
        robot: &args.robot,
        ports: &args.bus,
        output: args.output.as_deref(),
        directions: args.directions,
    };
    let written = calibration.run(Consent::from_flag(args.yes), |line| stdout_line!("{line}"))?;
    stdout_line!("wrote {}", written.display());
    Ok(ExitCode::SUCCESS)
}
