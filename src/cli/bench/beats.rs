//! `servodance bench beats`.

use servodance_lab::bench::beats::{self, BeatBenchOptions, BeatBenchReport};
use servodance_runtime::process::console::stdout_line;
use servodance_runtime::robot::Robot;
use std::path::PathBuf;
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  servodance bench beats songs/
      each NAME.wav (ogg, mp3, flac) against NAME.beats: a line a beat,
      seconds and place in the bar
  servodance bench beats songs/ --starts 6 --noise --jumps
      also a minute of each from six places, each in a room with noise and
      motors, and each followed by the next one
  servodance bench beats songs/ --motors op3
      what op3 hears while its motors whine as it dances
  servodance bench beats songs/ --json";

/// What `bench beats` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A folder of songs with their beats.
    #[arg(value_name = "SONGS_DIR")]
    pub songs: PathBuf,
    /// Also begin each song at so many places in it.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub starts: usize,
    /// Also play each song in a room, with pink noise and motors 10 dB below it.
    #[arg(long)]
    pub noise: bool,
    /// Also let half a minute of each song be followed by the next one.
    #[arg(long)]
    pub jumps: bool,
    /// Also let this robot dance to each song and hear its own motors, 6 dB below it.
    #[arg(long, value_name = "NAME|FILE.toml")]
    pub motors: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let motors = args.motors.as_deref().map(Robot::load).transpose()?;
    let Args { songs, starts, noise, jumps, .. } = args;
    let report = beats::run(&songs, &BeatBenchOptions { starts, noise, jumps, motors })?;
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
    more_lines(&report).iter().for_each(|line| stdout_line!("{line}"));
    Ok(ExitCode::SUCCESS)
}

fn more_lines(report: &BeatBenchReport) -> Vec<String> {
    let starts = report.starts.as_ref().map(|s| {
        format!(
            "from {} starts: F {:.3}, spread {:.2}, below 0.5 in {:.1} % of the minutes",
            s.starts,
            s.f,
            s.f_spread,
            100.0 * s.f_below_half_share
        )
    });
    let noise = report.noise.as_ref().map(|s| {
        format!(
            "room, noise, motors: F {:.3}, CMLt {:.3}, AMLt {:.3}; off-beat {:.1} %",
            s.f,
            s.cmlt,
            s.amlt,
            100.0 * s.off_beat_share
        )
    });
    let jumps = report.jumps.as_ref().map(|s| {
        format!(
            "{} jumps: right level again after {} (never {:.1} %)",
            s.jumps,
            s.locked_s_median.map_or("-".into(), |s| format!("{s:.1} s")),
            100.0 * s.never_locked_share
        )
    });
    let motors = report.motors.as_ref().map(|s| {
        format!(
            "{} dancing, its motors {:.1} dB below: F {:.3}, CMLt {:.3}, AMLt {:.3}; off-beat {:.1} %",
            s.robot,
            s.motors_below_db,
            s.f,
            s.cmlt,
            s.amlt,
            100.0 * s.off_beat_share
        )
    });
    [starts, noise, jumps, motors].into_iter().flatten().collect()
}
