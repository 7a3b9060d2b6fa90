//! `servodance beats`.

use crate::cli::prelude::*;
use servodance_runtime::offline::beats::{BeatTracker, Beats};

const EXAMPLES: &str = include_str!("examples/beats.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[arg(help = "The recording", value_name = "FILE")]
    pub file: PathBuf,
    /// Call each beat from what came before it, as live; else the
    /// whole recording is known.
    #[arg(long)]
    pub causal: bool,
    /// The file to write; standard output if left out.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Write one JSON object: tracker, audio_s, tempo_bpm, times_s.
    #[arg(long)]
    pub json: bool,
}

/// Finds the beats and writes them.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let hearing = if args.causal { BeatTracker::Causal } else { BeatTracker::Offline };
    let beats = Beats::find(&args.file, hearing)?;
    let text = if args.json { beats.to_json()? } else { beats.to_lines() };
    match args.out {
        Some(path) => write_whole(&path, text.as_bytes())?,
        None => stdout(format_args!("{text}")),
    }
    Ok(ExitCode::SUCCESS)
}
