//! `servodance soak`.

use crate::cli::options::file_ending::file_of;
use crate::cli::prelude::*;
use servodance_lab::soak::{Soak, SoakMusic};
use servodance_runtime::pipeline::model_args::EngineArgs;
use servodance_runtime::session::dance::open_generator;
use servodance_runtime::telemetry::pending_file::PendingFile;

const EXAMPLES: &str = include_str!("examples/soak.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Recordings to dance to; music, noise and silence are made if left out.
    #[arg(value_name = "AUDIO")]
    pub audio: Vec<PathBuf>,
    #[arg(help = "Minutes of music", long, default_value_t = 60.0, value_name = "MINUTES")]
    #[arg(value_parser = within(0.1..=100_000.0))]
    pub minutes: f64,
    /// Seconds of music of one dance.
    #[arg(long, default_value_t = 120.0, value_name = "SECONDS", value_parser = within(5.0..=3600.0))]
    pub piece: f64,
    /// Seconds between two faults, on average.
    #[arg(long, default_value_t = 40.0, value_name = "SECONDS", value_parser = within(0.1..=1e6))]
    pub fault_every: f64,
    #[command(flatten)]
    pub robot: RobotFileArgs,
    /// Weights to use in place of the built-in ones.
    #[arg(long, value_name = "FILE.safetensors")]
    pub model: Option<PathBuf>,
    /// The same seed meets the same faults.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Write all figures as JSON.
    #[arg(long, value_name = "FILE.json", value_parser = file_of("json"))]
    pub report: Option<PathBuf>,
    #[arg(help = "Show no progress", long, short)]
    pub quiet: bool,
}

/// Soaks; fails if anything was as it must not be.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let report = args.report.as_deref().map(PendingFile::create);
    drop(report.transpose()?); // only to learn early whether it can be written
    let soak = Soak {
        robot: args.robot.load()?,
        music: SoakMusic::new(args.audio, args.piece, args.seed),
        piece_s: args.piece,
        total_s: args.minutes * 60.0,
        fault_every_s: args.fault_every,
        seed: args.seed,
    };
    let generator = open_generator(args.model.as_deref(), EngineArgs::default())?;
    let stop = stop_signal()?;
    let progress = Progress::new(Some(soak.total_s), args.quiet);
    let summary = soak.run(&generator, &stop, |music_s| progress.at(music_s))?;
    progress.done();
    if let Some(path) = &args.report {
        let text = serde_json::to_string_pretty(&summary)? + "\n";
        write_whole(path, text.as_bytes())?;
    }
    stdout_line!("{}", summary.line());
    for objection in &summary.objections {
        stderr_line!("{objection}");
    }
    Ok(match (summary.passed, summary.interrupted) {
        (false, _) => ExitCode::FAILURE,
        (true, true) => ExitCode::from(INTERRUPTED),
        (true, false) => ExitCode::SUCCESS,
    })
}
