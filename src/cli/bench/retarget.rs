//! `servodance bench retarget`.

use crate::cli::prelude::*;
use servodance_lab::bench::retarget::{self as retarget_bench, RetargetBenchReport};

const EXAMPLES: &str = include_str!("../examples/bench-retarget.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A built-in robot, or a robot file.
    #[arg(long, default_value = "op3", value_name = "NAME|FILE.toml")]
    pub robot: String,
    /// The motion: .npz with `positions` [T, 22, 3] in metres (y up) and `fps`;
    /// else a dance by the choreographer.
    #[arg(long, value_name = "FILE.npz")]
    pub motion: Option<PathBuf>,
    /// Most seconds of motion.
    #[arg(long, default_value_t = 60.0, value_name = "S", value_parser = within(1.0..=600.0))]
    pub seconds: f64,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let robot = Robot::load(&args.robot)?;
    let clip = retarget_bench::motion(args.motion.as_deref(), args.seconds)?;
    let figures = retarget_bench::run(&robot, &clip)?;
    if args.json {
        stdout_line!("{}", serde_json::to_string(&figures)?);
    } else {
        let RetargetBenchReport { robot, joints, control_hz, allocations, cycles, .. } = &figures;
        let RetargetBenchReport { us_mean, us_p50, us_p99, us_max, .. } = &figures;
        let with = if figures.balance { ", balance included" } else { "" };
        stdout_line!(
            "{robot} ({joints} joints at {control_hz:.0} Hz), {}{with}: {us_mean:.1} us a cycle mean, \
             {us_p50:.1} p50, {us_p99:.1} p99, {us_max:.1} max; {allocations} allocations in {cycles} cycles",
            clip.name
        );
    }
    Ok(ExitCode::SUCCESS)
}
