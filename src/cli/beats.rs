//! `servodance beats`.

use crate::cli::prelude::*;
use servodance_audio::TempoRange;
use servodance_runtime::offline::beats::{BeatTracker, Beats};

const EXAMPLES: &str = include_str!("examples/beats.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(
    after_help = EXAMPLES,
    group = clap::ArgGroup::new("live").args(["causal", "downbeats"]).multiple(true)
)]
pub struct Args {
    #[arg(help = "The recording", value_name = "FILE")]
    pub file: PathBuf,
    /// Call each beat from what came before it, as live; else the
    /// whole recording is known.
    #[arg(long)]
    pub causal: bool,
    /// Follow no tempo but these, beats a minute, slowest and fastest; as live.
    #[arg(long, value_name = "LO-HI", requires = "live")]
    pub tempo: Option<TempoRange>,
    /// After each time the beat's place in its bar from 1, as heard live; 0 where no bar
    /// stands out.
    #[arg(long)]
    pub downbeats: bool,
    /// The file to write; standard output if left out.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Write one JSON object: tracker, audio_s, tempo_bpm, times_s, and with --causal
    /// meter, places, confidence, bar_confidence.
    #[arg(long)]
    pub json: bool,
}

/// Finds the beats and writes them.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let hearing =
        if args.causal || args.downbeats { BeatTracker::Causal } else { BeatTracker::Offline };
    let beats = Beats::find(&args.file, hearing, args.tempo)?;
    let text = match (args.json, args.downbeats) {
        (true, _) => beats.to_json()?,
        (false, true) => beats.to_placed_lines(),
        (false, false) => beats.to_lines(),
    };
    match args.out {
        Some(path) => write_whole(&path, text.as_bytes())?,
        None => stdout(format_args!("{text}")),
    }
    Ok(ExitCode::SUCCESS)
}
