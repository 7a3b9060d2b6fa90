//! `servodance retarget`.

use servodance_runtime::offline::retarget_motion::{self, RetargetRequest};
use servodance_runtime::process::console::stdout_line;
use servodance_training::motion::format::read_motion;
use std::path::PathBuf;
use std::process::ExitCode;

const EXAMPLES: &str = include_str!("examples/retarget.txt").trim_ascii_end();

/// What `retarget` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The motion: .bvh, .npz (22 joints), .pkl (AIST++), .amc beside its .asf, or .npy (HumanML3D).
    #[arg(value_name = "MOTION")]
    pub motion: PathBuf,
    /// A built-in robot (see `servodance robots`) or a robot file.
    #[arg(long, default_value = "op3", value_name = "NAME|FILE.toml")]
    pub robot: String,
    /// Joint positions: `time_s` and a column of radians a joint (.csv),
    /// or a recording (.mcap).
    #[arg(long, value_name = "FILE.csv|.mcap")]
    pub out: PathBuf,
    /// Write figures as JSON.
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    #[arg(help = "Print only errors", long, short)]
    pub quiet: bool,
}

/// Retargets and prints what came of it.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let request = RetargetRequest {
        motion: args.motion,
        robot: args.robot,
        out: args.out,
        report: args.report,
    };
    let lines = retarget_motion::retarget(&request, |path| Ok(read_motion(path)?))?;
    if !args.quiet {
        for line in lines {
            stdout_line!("{line}");
        }
    }
    Ok(ExitCode::SUCCESS)
}
