//! Training as a user runs it: settings from a file, progress, curves,
//! checkpoints and weights in a folder. The learning itself is
//! [`crate::train`].
//!
//! Refused settings and data leave nothing behind. A run that is stopped saves
//! a checkpoint first, and goes on from it to the same bytes.

mod curves;
mod settings;

use crate::train::{
    CurveRow, Data, Settings, SettingsFile, StageKind, StageOne, StepReport, Trainer, with_threads,
};
use anyhow::{Context, bail};
use curves::CurveFile;
use servodance_runtime::output::write_whole;
use servodance_runtime::progress::Progress;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// What is asked for; what is given here goes before what the file says.
#[derive(Clone, Debug)]
pub struct Request {
    /// Which stage.
    pub stage: StageKind,
    /// The settings, a TOML file.
    pub config: PathBuf,
    /// The training file.
    pub data: Option<PathBuf>,
    /// The folder to write to.
    pub out: Option<PathBuf>,
    /// Weights of stage 1, for stage 2.
    pub stage_one: Option<PathBuf>,
    /// Everything random follows from it.
    pub seed: Option<u64>,
    /// Threads to work with.
    pub threads: Option<usize>,
    /// Stop, to go on later, when so many steps are taken.
    pub until: Option<u64>,
    /// Go on from the checkpoint.
    pub resume: bool,
    /// Print only errors.
    pub quiet: bool,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// All steps are taken.
    Done,
    /// The scores had not improved for long enough.
    Early,
    /// At the step asked for.
    Until,
    /// By Ctrl-C.
    Stopped,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// How it ended.
    pub end: End,
    /// Steps taken in all.
    pub steps: u64,
    /// The folder of the stage.
    pub folder: PathBuf,
    /// The last line of the curves.
    pub last: Option<CurveRow>,
}

/// The files of a stage.
struct Files {
    folder: PathBuf,
}

impl Files {
    fn checkpoint(&self) -> PathBuf {
        self.folder.join("last.safetensors")
    }

    fn weights(&self) -> PathBuf {
        self.folder.join("weights.safetensors")
    }
}

/// Trains until the end, `until`, or until `stop` is set.
///
/// # Errors
/// Settings, data or checkpoint that cannot be used; a loss that is no number.
pub fn train(request: &Request, stop: &AtomicBool) -> anyhow::Result<Outcome> {
    let file = settings::read(&request.config, request)?;
    let config = request.config.display();
    let resolved = file
        .resolve(request.stage)
        .with_context(|| format!("{config}"))?;
    let data = needed(&file.data, "data", request)?;
    let out = needed(&file.out, "out", request)?;
    let files = Files {
        folder: out.join(request.stage.name()),
    };
    let checkpoint = checkpoint(&files, request.resume)?;
    with_threads(file.threads.unwrap_or(0), || {
        let mut trainer = trainer(&file, resolved, &data, &out)?;
        if let Some(bytes) = checkpoint {
            let name = files.checkpoint();
            let resumed = trainer.resume(&bytes);
            resumed.with_context(|| format!("{}", name.display()))?;
        }
        std::fs::create_dir_all(&files.folder)
            .with_context(|| format!("cannot make the folder {}", files.folder.display()))?;
        run(request, trainer, files, stop)
    })
}

fn needed(path: &Option<PathBuf>, key: &str, request: &Request) -> anyhow::Result<PathBuf> {
    let missing = || {
        format!(
            "{}: `{key}` is missing (or give --{key})",
            request.config.display()
        )
    };
    path.clone().with_context(missing)
}

/// The checkpoint to go on from. One that would be overwritten is refused.
fn checkpoint(files: &Files, resume: bool) -> anyhow::Result<Option<Vec<u8>>> {
    let path = files.checkpoint();
    let name = path.display();
    match (resume, path.exists()) {
        (false, true) => {
            bail!("{name} is there already: --resume goes on from it, another --out begins anew")
        }
        (false, false) => Ok(None),
        (true, _) => {
            let bytes = std::fs::read(&path);
            Ok(Some(
                bytes.with_context(|| format!("cannot go on from {name}"))?,
            ))
        }
    }
}

fn trainer(
    file: &SettingsFile,
    settings: Settings,
    data: &Path,
    out: &Path,
) -> anyhow::Result<Trainer> {
    let data = Data::read(data)?;
    let stage_one = match settings.stage {
        StageKind::VqVae => None,
        StageKind::MotionSeq => {
            let in_out = out
                .join(StageKind::VqVae.name())
                .join("weights.safetensors");
            let path = file.stage_one.clone().unwrap_or(in_out);
            let name = path.display();
            let bytes = std::fs::read(&path).with_context(|| {
                format!("cannot read the weights of stage 1, {name} (`servodance train vqvae` makes them)")
            })?;
            Some(StageOne::open(&bytes, &name.to_string())?)
        }
    };
    Ok(Trainer::new(settings, data, stage_one)?)
}

fn run(
    request: &Request,
    mut trainer: Trainer,
    files: Files,
    stop: &AtomicBool,
) -> anyhow::Result<Outcome> {
    let steps = trainer.settings().run.steps;
    let every = trainer.settings().run.checkpoint;
    let until = request.until.unwrap_or(steps).min(steps);
    let mut curves = CurveFile::open(&files.folder, trainer.steps_taken(), request.stage)?;
    let progress = Progress::steps(steps, trainer.steps_taken(), request.quiet);
    let (mut early, mut last) = (false, None);
    while trainer.steps_taken() < until && !early && !stop.load(Ordering::Acquire) {
        let step = trainer.step();
        let report = step.with_context(|| format!("{} is as it was", files.folder.display()))?;
        progress.step(report.step, in_short(&report));
        if trainer.line_is_due() {
            let line = trainer.line();
            progress.note(&line_of_text(&line));
            curves.add(&line)?;
            if line.best {
                write_whole(&files.weights(), &trainer.weights())?;
            }
            early = line.stale;
            last = Some(line);
        }
        if trainer.steps_taken().is_multiple_of(every) {
            write_whole(&files.checkpoint(), &trainer.checkpoint())?;
        }
    }
    progress.done();
    write_whole(&files.checkpoint(), &trainer.checkpoint())?;
    if !files.weights().exists() {
        write_whole(&files.weights(), &trainer.weights())?;
    }
    let taken = trainer.steps_taken();
    let end = match (taken >= steps, early, taken >= until) {
        (true, ..) => End::Done,
        (_, true, _) => End::Early,
        (.., true) => End::Until,
        _ => End::Stopped,
    };
    Ok(Outcome {
        end,
        steps: taken,
        folder: files.folder,
        last,
    })
}

/// What stands beside the bar.
fn in_short(report: &StepReport) -> String {
    let loss = report.terms.first().map_or(0.0, |term| term.1);
    let used = report.terms.iter().find(|(name, _)| name == "codes_used");
    let used = used.map_or(String::new(), |(_, share)| {
        format!(", {:.0} % of codes used", 100.0 * share)
    });
    format!(
        "loss {loss:.4}, learning rate {:.1e}{used}",
        report.learning_rate
    )
}

fn line_of_text(line: &CurveRow) -> String {
    let mut text = format!("step {}:", line.step);
    for (name, value) in line.values.iter().filter(|(_, value)| value.is_finite()) {
        text += &format!(" {name} {value:.4}");
    }
    text
}
