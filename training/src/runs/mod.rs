//! Training as a user runs it: settings from a file, progress, curves,
//! checkpoints and weights in a folder. The learning itself is
//! [`crate::train`].
//!
//! Refused settings and data leave nothing behind. A run that is stopped saves
//! a checkpoint first, and goes on from it to the same bytes.

pub(crate) mod curves;
mod request;
mod settings;

pub use request::TrainingRequest;

use crate::train::{
    CurveRow, SettingsFile, StepReport, TrainedNetwork, Trainer, TrainingData, TrainingSettings,
    VqVaeWeights, with_threads,
};
use anyhow::{Context, bail};
use curves::CurveFile;
use servodance_runtime::process::progress::Progress;
use servodance_runtime::telemetry::pending_file::write_whole;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunEnd {
    /// All steps of the settings are taken.
    Done,
    /// The scores had not improved for long enough.
    Early,
    /// At the step that `until` names.
    Until,
    /// By `stop`, at a Ctrl-C; a checkpoint is saved.
    Stopped,
}

/// Where a run stands when it returns.
#[derive(Clone, Debug)]
pub struct RunOutcome {
    /// How the run came to its end.
    pub end: RunEnd,
    /// Steps taken since the first start.
    pub steps: u64,
    /// The folder with checkpoint, weights and curves.
    pub folder: PathBuf,
}

struct RunFolder {
    folder: PathBuf,
}

impl RunFolder {
    fn checkpoint(&self) -> PathBuf {
        self.folder.join("last.safetensors")
    }

    fn weights(&self) -> PathBuf {
        self.folder.join("weights.safetensors")
    }
}

/// Trains until the end, `until`, or until `stop` is set. Fails on settings, data or checkpoint
/// that cannot be used; a loss that is no number.
pub fn train(request: &TrainingRequest, stop: &AtomicBool) -> anyhow::Result<RunOutcome> {
    let file = settings::read(&request.config, request)?;
    let config = request.config.display();
    let resolved = file.resolve(request.network).with_context(|| format!("{config}"))?;
    let data = required_path(&file.data, "data", request)?;
    let out = required_path(&file.out, "out", request)?;
    let files = RunFolder { folder: out.join(request.network.name()) };
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

fn required_path(
    path: &Option<PathBuf>,
    key: &str,
    request: &TrainingRequest,
) -> anyhow::Result<PathBuf> {
    let missing = || format!("{}: `{key}` is missing (or give --{key})", request.config.display());
    path.clone().with_context(missing)
}

/// The checkpoint to go on from. One that would be overwritten is refused.
fn checkpoint(files: &RunFolder, resume: bool) -> anyhow::Result<Option<Vec<u8>>> {
    let path = files.checkpoint();
    let name = path.display();
    match (resume, path.exists()) {
        (false, true) => {
            bail!("{name} is there already: --resume goes on from it, another --out begins anew")
        }
        (false, false) => Ok(None),
        (true, _) => {
            let bytes = std::fs::read(&path);
            Ok(Some(bytes.with_context(|| format!("cannot go on from {name}"))?))
        }
    }
}

fn trainer(
    file: &SettingsFile,
    settings: TrainingSettings,
    data: &Path,
    out: &Path,
) -> anyhow::Result<Trainer> {
    let data = TrainingData::read(data)?;
    let in_out = out.join(TrainedNetwork::VqVae.name()).join("weights.safetensors");
    let path = match settings.network {
        TrainedNetwork::VqVae => file.vqvae_weights.clone(),
        TrainedNetwork::MotionSeq => Some(file.vqvae_weights.clone().unwrap_or(in_out)),
    };
    let vqvae_weights = path.map(|path| open_vqvae(&path)).transpose()?;
    Ok(Trainer::new(settings, data, vqvae_weights)?)
}

fn open_vqvae(path: &Path) -> anyhow::Result<VqVaeWeights> {
    let name = path.display();
    let bytes = std::fs::read(path).with_context(|| {
        format!("cannot read the weights of stage 1, {name} (`servodance train vqvae` makes them)")
    })?;
    Ok(VqVaeWeights::open(&bytes, &name.to_string())?)
}

fn run(
    request: &TrainingRequest,
    mut trainer: Trainer,
    files: RunFolder,
    stop: &AtomicBool,
) -> anyhow::Result<RunOutcome> {
    let steps = trainer.settings().run.steps;
    let every = trainer.settings().run.checkpoint;
    let until = request.until.unwrap_or(steps).min(steps);
    let mut curves = CurveFile::open(&files.folder, trainer.steps_taken(), request.network)?;
    let progress = Progress::steps(steps, trainer.steps_taken(), request.quiet);
    let mut early = false;
    while trainer.steps_taken() < until && !early && !stop.load(Ordering::Acquire) {
        let step = trainer.step();
        let report = step.with_context(|| format!("{} is as it was", files.folder.display()))?;
        progress.step(report.step, progress_text(&report));
        if trainer.curve_row_is_due() {
            let line = trainer.curve_row();
            progress.note(&curve_text(&line));
            curves.add(&line)?;
            if line.best {
                write_whole(&files.weights(), &trainer.weights())?;
            }
            early = line.stale;
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
        (true, ..) => RunEnd::Done,
        (_, true, _) => RunEnd::Early,
        (.., true) => RunEnd::Until,
        _ => RunEnd::Stopped,
    };
    Ok(RunOutcome { end, steps: taken, folder: files.folder })
}

fn progress_text(report: &StepReport) -> String {
    let loss = report.terms.first().map_or(0.0, |term| term.1);
    let used = report.terms.iter().find(|(name, _)| name == "codes_used");
    let used =
        used.map_or(String::new(), |(_, share)| format!(", {:.0} % of codes used", 100.0 * share));
    format!("loss {loss:.4}, learning rate {:.1e}{used}", report.learning_rate)
}

fn curve_text(line: &CurveRow) -> String {
    let mut text = format!("step {}:", line.step);
    for (name, value) in line.values.iter().filter(|(_, value)| value.is_finite()) {
        text += &format!(" {name} {value:.4}");
    }
    text
}
