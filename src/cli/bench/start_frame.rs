//! `servodance bench start-frame`.

use crate::cli::prelude::*;
use servodance_lab::bench::retarget::motion;
use servodance_lab::bench::start_frame::{self, FarthestJoint, StartFrameReport};
use servodance_runtime::robot::BUILT_IN;

const EXAMPLES: &str = include_str!("../examples/bench-start-frame.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Built-in robots, or robot files; every built-in one if left out.
    #[arg(long, value_name = "NAME|FILE.toml", num_args = 1..)]
    pub robot: Vec<String>,
    /// Motions: .npz with `positions` [T, 22, 3] in metres (y up) and `fps`;
    /// else a dance by the choreographer.
    #[arg(long, value_name = "FILE.npz", num_args = 1..)]
    pub motion: Vec<PathBuf>,
    /// Most seconds of each motion.
    #[arg(long, default_value_t = 60.0, value_name = "S", value_parser = within(15.0..=600.0))]
    pub seconds: f64,
    /// Print one JSON object a robot.
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let motions = match args.motion.is_empty() {
        true => vec![motion(None, args.seconds)?],
        false => {
            let read = |file: &PathBuf| motion(Some(file), args.seconds);
            args.motion.iter().map(read).collect::<anyhow::Result<Vec<_>>>()?
        }
    };
    let names = match args.robot.is_empty() {
        true => BUILT_IN.iter().map(|robot| robot.name.to_owned()).collect(),
        false => args.robot,
    };
    for name in names {
        let report = start_frame::run(&Robot::load(&name)?, &motions)?;
        if args.json {
            stdout_line!("{}", serde_json::to_string(&report)?);
        } else {
            print(&report);
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn print(report: &StartFrameReport) {
    let place = |farthest: &FarthestJoint| match farthest.joint.as_str() {
        "" => "0 degrees".to_owned(),
        joint => format!("{:.1} degrees ({joint}, {})", farthest.deg, farthest.motion),
    };
    stdout_line!("{}: {} motions begun at frame 200", report.robot, report.cut);
    stdout_line!("  steady parts, from 0.5 s on: {}", place(&report.steady));
    let share = report.share_beyond_5_deg * 100.0;
    stdout_line!(
        "  everywhere, from 2 s on: {}; {share:.2} % beyond 5 degrees",
        place(&report.settled)
    );
    stdout_line!(
        "  arms off by {:.1} degrees (median), jerk {:.0} rad/s^3",
        report.arms_deg,
        report.jerk_rad_s3
    );
    stdout_line!("  about the vertical, from rest: {}", place(&report.yaw));
}
