//! `servodance dataset`: import, report, build.

use anyhow::bail;
use clap::Subcommand;
use servodance_model::conditioning::{Encodec, MusicKind};
use servodance_runtime::pipeline::conditioning::open_encodec;
use servodance_runtime::process::console::{stderr_line, stdout_line};
use servodance_runtime::process::progress::Progress;
use servodance_runtime::telemetry::pending_file::write_whole;
use servodance_training::dataset::{DatasetOptions, DatasetReport, ImportRequest, build, import};
use servodance_training::motion::format::ImportFormat;
use std::path::PathBuf;
use std::process::ExitCode;

const IMPORT_EXAMPLES: &str = "\
Examples:
  servodance dataset import aist aist_plusplus/motions --music aist/wav --out data
      AIST++ with the songs that were danced to
  servodance dataset import bvh lafan1 --source lafan1 --licence \"CC BY-NC-ND 4.0\" --dance --out data
      any BVH; the joints that were found are printed
  servodance dataset import bvh mine.bvh --mapping joints.toml --out data
      with corrections, e.g. a line: left_wrist = \"L_Palm\"";

const BUILD_EXAMPLES: &str = "\
Examples:
  servodance dataset build data.safetensors --motion data --songs 4 --choreography 90
      what `servodance train` reads, and `servodance evaluate --data`
  servodance dataset build tiny.safetensors --choreography 5
      choreography alone: needs no data
  servodance dataset build data.safetensors --motion data --music-features encodec128 --encodec encodec_24khz/model.safetensors
      with what Encodec hears beside it (see docs/conditioning.md)";

const EXAMPLES: &str = "\
Examples:
  servodance dataset import bvh lafan1 --dance --out data
  servodance dataset report data --sheet sheet.png
  servodance dataset build data.safetensors --motion data
      motion comes in, is looked over, becomes what `servodance train` reads";

/// Data to train with.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    pub command: Command,
}

/// What can be done with data.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Bring motion of other programs into a folder of clips.
    Import(ImportArgs),
    /// Say what is in a folder of clips; draw a sheet of them.
    Report(ReportArgs),
    /// Write the training file: motion, music on its beats, choreography, splits.
    Build(BuildArgs),
}

/// What `dataset import` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = IMPORT_EXAMPLES)]
pub struct ImportArgs {
    /// aist (pkl), humanml3d (npy), bvh, amc (beside its asf), smpl (npz, as in
    /// AMASS) or npz (22 joints).
    #[arg(value_parser = kind)]
    pub kind: ImportFormat,
    /// A file, or a folder of them.
    pub path: PathBuf,
    /// The folder to write to; what it holds of other imports stays.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Whose motion it is, one word.
    #[arg(long, value_name = "NAME")]
    pub source: Option<String>,
    /// On what terms it may be used.
    #[arg(long, value_name = "TEXT")]
    pub licence: Option<String>,
    /// It is dance (AIST++ always is).
    #[arg(long)]
    pub dance: bool,
    /// The style of the dance; an unknown one lists those that there are.
    #[arg(long, value_name = "NAME")]
    pub style: Option<String>,
    /// A folder of recordings, named as the clips or as AIST++'s songs.
    #[arg(long, value_name = "DIR")]
    pub music: Option<PathBuf>,
    /// Which features of the music are written.
    #[command(flatten)]
    pub features: FeatureArgs,
    /// Which joint of the skeleton a body joint is, where the guess is wrong.
    #[arg(long, value_name = "FILE.toml")]
    pub mapping: Option<PathBuf>,
    /// Frames a second, in place of what the files say.
    #[arg(long, value_name = "N")]
    pub fps: Option<f64>,
    /// Print only errors and what was skipped.
    #[arg(long, short)]
    pub quiet: bool,
}

/// What `dataset report` is asked for.
#[derive(Debug, clap::Args)]
pub struct ReportArgs {
    /// A folder that `dataset import` wrote.
    pub folder: PathBuf,
    /// The sheet to draw; `sheet.png` in the folder if left out.
    #[arg(long, value_name = "FILE.png")]
    pub sheet: Option<PathBuf>,
    /// Print JSON in place of the table.
    #[arg(long)]
    pub json: bool,
}

/// What `dataset build` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = BUILD_EXAMPLES)]
pub struct BuildArgs {
    /// The file to write.
    #[arg(value_name = "FILE.safetensors")]
    pub out: PathBuf,
    /// A folder that `dataset import` wrote; choreography alone if left out.
    #[arg(long, value_name = "DIR")]
    pub motion: Option<PathBuf>,
    /// Songs for every captured dance with a beat.
    #[arg(long, default_value_t = 4, value_name = "N")]
    pub songs: usize,
    #[arg(help = "Minutes of choreography", long, default_value_t = 90.0, value_name = "MINUTES")]
    pub choreography: f64,
    /// Which features of the music are written.
    #[command(flatten)]
    pub features: FeatureArgs,
    /// Everything random follows from it.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    #[arg(help = "No progress bar", long, short)]
    pub quiet: bool,
}

/// Which features of the music are written.
#[derive(Debug, clap::Args)]
pub struct FeatureArgs {
    /// servodance39 (librosa35 is part of it), or encodec128 beside it.
    #[arg(long, default_value = "servodance39", value_parser = music_kind)]
    pub music_features: MusicKind,
    /// Encodec's model.safetensors, if it is not in servodance/encodec_24khz in
    /// the user's data folder (see docs/conditioning.md).
    #[arg(long, value_name = "FILE.safetensors")]
    pub encodec: Option<PathBuf>,
}

impl FeatureArgs {
    fn encodec(&self) -> anyhow::Result<Option<Encodec>> {
        match (self.music_features, &self.encodec) {
            (MusicKind::Encodec128, path) => open_encodec(path.as_deref()).map(Some),
            (_, None) => Ok(None),
            (_, Some(_)) => bail!("--encodec needs --music-features encodec128"),
        }
    }
}

fn music_kind(text: &str) -> Result<MusicKind, String> {
    let names = MusicKind::ALL.map(MusicKind::name).join(", ");
    MusicKind::from_name(text).ok_or_else(|| format!("choose one of {names}"))
}

fn kind(text: &str) -> Result<ImportFormat, String> {
    let found = ImportFormat::ALL.into_iter().find(|kind| kind.name() == text);
    found.ok_or_else(|| {
        format!("choose one of {}", ImportFormat::ALL.map(ImportFormat::name).join(", "))
    })
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    match args.command {
        Command::Import(args) => run_import(args),
        Command::Report(args) => run_report(args),
        Command::Build(args) => run_build(args),
    }
}

fn run_import(args: ImportArgs) -> anyhow::Result<ExitCode> {
    let progress = Progress::share("importing", args.quiet);
    let request = ImportRequest {
        kind: args.kind,
        path: args.path,
        out: args.out,
        source: args.source,
        licence: args.licence,
        dance: args.dance,
        style: args.style,
        music: args.music,
        encodec: args.features.encodec()?,
        mapping: args.mapping,
        fps: args.fps,
    };
    let tell = |line: &str| match args.quiet {
        true if line.starts_with("skipped") => stderr_line!("{line}"),
        _ => progress.note(line),
    };
    let done = import(&request, tell, |share| progress.at(100.0 * share));
    progress.done();
    let done = done?;
    if done.clips == 0 {
        bail!(
            "{}: nothing could be imported, {} files were skipped",
            request.path.display(),
            done.skipped.len()
        );
    }
    if !args.quiet {
        stdout_line!(
            "{}: {} clips, {:.1} minutes, {} with music; {} files skipped, {} mirrored copies left out",
            request.out.display(),
            done.clips,
            done.minutes,
            done.with_music,
            done.skipped.len(),
            done.mirrored
        );
    }
    Ok(ExitCode::SUCCESS)
}

fn run_report(args: ReportArgs) -> anyhow::Result<ExitCode> {
    let progress = Progress::share("looking", args.json);
    let report = DatasetReport::of(&args.folder, |share| progress.at(100.0 * share));
    progress.done();
    let report = report?;
    let title = format!("Motion in {}", args.folder.display());
    let sheet = args.sheet.unwrap_or_else(|| args.folder.join("sheet.png"));
    write_whole(&sheet, &report.sheet(&title)?)?;
    match args.json {
        true => stdout_line!("{}", serde_json::to_string_pretty(&report)?),
        false => servodance_runtime::process::console::stdout(format_args!("{}", report.table())),
    }
    Ok(ExitCode::SUCCESS)
}

fn run_build(args: BuildArgs) -> anyhow::Result<ExitCode> {
    if !(0.0..=10_000.0).contains(&args.choreography) {
        bail!("--choreography {} is outside 0..10000", args.choreography);
    }
    let progress = Progress::share("building", args.quiet);
    let options = DatasetOptions {
        motion: args.motion,
        out: args.out,
        songs_per_clip: args.songs,
        choreography_minutes: args.choreography,
        seed: args.seed,
        encodec: args.features.encodec()?,
    };
    let built = build(&options, &|share| progress.at(100.0 * share));
    progress.done();
    let summary = built?;
    for reason in &summary.left_out {
        stderr_line!("left out: {reason}");
    }
    if !args.quiet {
        for (kind, minutes) in &summary.minutes {
            stdout_line!("{minutes:7.2} min  {kind}");
        }
        stdout_line!(
            "{} clips; captured dance {:.1} min, {:.1} of them with a beat to render music on",
            summary.clips,
            summary.captured_dance_minutes,
            summary.captured_dance_with_beat_minutes
        );
    }
    Ok(ExitCode::SUCCESS)
}
