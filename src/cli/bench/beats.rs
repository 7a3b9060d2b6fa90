//! `servodance bench beats`.

use servodance_lab::bench::beats;
use servodance_runtime::process::console::stdout_line;
use std::path::PathBuf;
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  servodance bench beats songs/
      each NAME.wav (ogg, mp3, flac) against NAME.beats: a line a beat,
      seconds and place in the bar
  servodance bench beats songs/ --json";

/// What `bench beats` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A folder of songs with their beats.
    #[arg(value_name = "SONGS_DIR")]
    pub songs: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let report = beats::run(&args.songs)?;
    if args.json {
        stdout_line!("{}", serde_json::to_string(&report)?);
        return Ok(ExitCode::SUCCESS);
    }
    for song in &report.each {
        stdout_line!(
            "{:32} F {:.2}  CMLt {:.2}  AMLt {:.2}  {:5.1} of {:5.1} BPM",
            song.name,
            song.f,
            song.cmlt,
            song.amlt,
            song.tempo_bpm,
            song.true_tempo_bpm
        );
    }
    stdout_line!(
        "{} songs: F {:.3} (median {:.3}), CMLt {:.3}, AMLt {:.3}; off-beat {:.1} %, F below 0.5 {:.1} %; \
         right level after {} (never {:.1} %); downbeats F {}; {:.1} ms a second of sound",
        report.songs,
        report.f,
        report.f_median,
        report.cmlt,
        report.amlt,
        100.0 * report.off_beat_share,
        100.0 * report.f_below_half_share,
        report.locked_s_median.map_or("-".into(), |s| format!("{s:.1} s")),
        100.0 * report.never_locked_share,
        report.downbeat_f.map_or("-".into(), |f| format!("{f:.2}")),
        report.cost_ms_per_s
    );
    Ok(ExitCode::SUCCESS)
}
