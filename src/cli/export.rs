//! `servodance export`.

use crate::cli::options::file_ending::file_of;
use crate::cli::prelude::*;
use servodance_runtime::telemetry::export::{ExportSpan, bvh, csv, film, gif};
use servodance_runtime::telemetry::recorder::Recording;

const EXAMPLES: &str = include_str!("examples/export.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
#[command(group = clap::ArgGroup::new("outputs").required(true).multiple(true).args(["gif", "film", "bvh", "csv"]))]
pub struct Args {
    /// A recording made by `dance --record`.
    #[arg(value_name = "FILE.mcap")]
    pub recording: PathBuf,
    #[arg(help = "A moving picture", long, value_name = "FILE.gif", value_parser = file_of("gif"))]
    pub gif: Option<PathBuf>,
    /// A film with the song: MP4 or WebM by its ending, encoded by the program ffmpeg of this
    /// machine.
    #[arg(long, value_name = "FILE.mp4|.webm")]
    pub film: Option<PathBuf>,
    /// Where in the music picture and film begin, seconds.
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS")]
    pub from: f64,
    /// How long they are; ten seconds for the picture, to the end for the film, if left out.
    #[arg(long, value_name = "SECONDS")]
    pub seconds: Option<f64>,
    /// The human motion: joint angles.
    #[arg(long, value_name = "FILE.bvh", value_parser = file_of("bvh"))]
    pub bvh: Option<PathBuf>,
    /// What the servos reported: a line a control cycle, radians.
    #[arg(long, value_name = "FILE.csv", value_parser = file_of("csv"))]
    pub csv: Option<PathBuf>,
}

/// Reads the recording, writes what is asked for, and says where.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let recording = Recording::read_all(&args.recording)?;
    if let Some(path) = &args.csv {
        csv(&recording, path)?;
    }
    if let Some(path) = &args.bvh {
        bvh(&recording, path)?;
    }
    if let Some(path) = &args.gif {
        let seconds = args.seconds.unwrap_or(10.0);
        gif(&recording, ExportSpan { from_s: args.from, seconds }, path)?;
    }
    if let Some(path) = &args.film {
        let seconds = args.seconds.unwrap_or(f64::INFINITY);
        let encoder = film(&recording, ExportSpan { from_s: args.from, seconds }, path)?;
        stderr_line!("{encoder}");
    }
    for path in [args.csv, args.bvh, args.gif, args.film].into_iter().flatten() {
        stdout_line!("{}", path.display());
    }
    Ok(ExitCode::SUCCESS)
}
