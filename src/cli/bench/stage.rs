//! `servodance bench stage`.

use servodance_runtime::process::number_range::within;
use std::process::ExitCode;

const EXAMPLES: &str = include_str!("../examples/bench-stage.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Simulated robots, each a program of its own.
    #[arg(long, default_value_t = 4, value_name = "N", value_parser = within(1..=64_usize))]
    pub followers: usize,
    /// Which robot they all are.
    #[arg(long, default_value = "neck", value_name = "NAME|FILE.toml")]
    pub robot: String,
    /// Delay of the network each way, milliseconds; a fifth of it is jitter on top.
    #[arg(long, default_value_t = 1.0, value_name = "MS", value_parser = within(0.0..=500.0))]
    pub delay_ms: f64,
    /// Share of what is sent that is lost and sent again.
    #[arg(long, default_value_t = 0.0, value_name = "SHARE", value_parser = within(0.0..=0.5))]
    pub loss: f64,
    /// Seconds that are measured before things go wrong.
    #[arg(long, default_value_t = 30.0, value_name = "SECONDS", value_parser = within(5.0..=3600.0))]
    pub seconds: f64,
    /// Each program in a network namespace of its own (Linux, root).
    #[arg(long)]
    pub namespaces: bool,
    /// The same seed has the same clocks wrong.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

#[cfg(not(feature = "stage"))]
pub fn run(_: Args) -> anyhow::Result<ExitCode> {
    crate::cli::options::stage::not_built_in("bench stage")
}

#[cfg(feature = "stage")]
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    use servodance_runtime::process::console::{stdout, stdout_line};

    servodance_runtime::robot::Robot::load(&args.robot)?;
    let stop = crate::cli::stop_signal()?;
    let figures = servodance_lab::bench::stage::bench(
        &servodance_lab::bench::stage::StageBench {
            followers: args.followers,
            robot: args.robot,
            delay_ms: args.delay_ms,
            loss: args.loss,
            seconds: args.seconds,
            namespaces: args.namespaces,
            seed: args.seed,
        },
        &stop,
    )?;
    if args.json {
        stdout_line!("{}", serde_json::to_string(&figures)?);
    } else {
        stdout(format_args!("{figures}"));
    }
    Ok(ExitCode::SUCCESS)
}
