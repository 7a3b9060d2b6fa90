//! `servodance dataset`: import, report, build.

use crate::cli::prelude::*;
use clap::Subcommand;
use servodance_training::dataset::{
    DatasetOptions, DatasetReport, ImportRequest, ImportSummary, build, import,
};

const IMPORT_EXAMPLES: &str = include_str!("examples/dataset-import.txt").trim_ascii_end();

const BUILD_EXAMPLES: &str = include_str!("examples/dataset-build.txt").trim_ascii_end();

const EXAMPLES: &str = include_str!("examples/dataset.txt").trim_ascii_end();

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

#[derive(Debug, clap::Args)]
#[command(after_help = IMPORT_EXAMPLES)]
pub struct ImportArgs {
    #[command(flatten)]
    request: ImportRequest,
}

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

#[derive(Debug, clap::Args)]
#[command(after_help = BUILD_EXAMPLES)]
pub struct BuildArgs {
    #[command(flatten)]
    options: DatasetOptions,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    match args.command {
        Command::Import(args) => run_import(args),
        Command::Report(args) => run_report(args),
        Command::Build(args) => run_build(args),
    }
}

fn run_import(ImportArgs { request }: ImportArgs) -> anyhow::Result<ExitCode> {
    let progress = Progress::share("importing", request.quiet);
    let tell = |line: &str| match request.quiet {
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
    if !request.quiet {
        let ImportSummary { clips, minutes, with_music, skipped, mirrored } = done;
        let (out, skipped) = (request.out.display(), skipped.len());
        stdout_line!(
            "{out}: {clips} clips, {minutes:.1} minutes, {with_music} with music; \
             {skipped} files skipped, {mirrored} mirrored copies left out"
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
        false => stdout(format_args!("{}", report.table())),
    }
    Ok(ExitCode::SUCCESS)
}

fn run_build(BuildArgs { options }: BuildArgs) -> anyhow::Result<ExitCode> {
    if options.figures > 0.0 && options.motion.is_none() {
        bail!("--figures needs --motion: figures are cut from captured dance");
    }
    if options.tilted > 0.0 && options.motion.is_none() {
        bail!("--tilted needs --motion: captured motion is turned over");
    }
    let progress = Progress::share("building", options.quiet);
    let built =
        build(&options, options.features.encodec()?.as_ref(), &|share| progress.at(100.0 * share));
    progress.done();
    let summary = built?;
    for reason in &summary.left_out {
        stderr_line!("left out: {reason}");
    }
    if !options.quiet {
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
