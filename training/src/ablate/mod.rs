//! What each part of the model is good for: it is trained without that part, on
//! the same data for as many steps, and scored like the whole (the MAGMA
//! paper's Table 3 in kind).
//!
//! Every variant has a folder with its settings, curves and weights, which
//! `servodance train` and `evaluate` understand as well. A run that was stopped
//! goes on where it stood. Small budgets rank variants, they do not measure them:
//! intervals are over dances, not over trainings.

mod table;
mod variant;

use crate::evaluate::{self, Evaluation, evaluate};
use crate::runs::{self, train};
use crate::train::{SettingsFile, StageKind};
use anyhow::Context;
use serde::{Deserialize, Serialize};
use servodance_model::GeneratorOptions;
use servodance_model::engine::EngineOptions;
use servodance_runtime::output::write_whole;
use servodance_runtime::progress::Progress;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
pub use table::Table;
pub use variant::{VARIANTS, Variant};

/// What is asked for.
#[derive(Clone, Debug)]
pub struct Request {
    /// Settings of the whole model, as `servodance train` reads them.
    pub config: PathBuf,
    /// The training file.
    pub data: PathBuf,
    /// The same with Encodec latents; without it that variant is left out.
    pub latents: Option<PathBuf>,
    /// The Encodec that these are of, if it is not in the user's data folder.
    pub encodec: Option<PathBuf>,
    /// The folder to write to.
    pub out: PathBuf,
    /// Names of the variants beside the whole model; all if empty.
    pub only: Vec<String>,
    /// How often everything is danced anew, and clips danced to each time.
    pub repeats: usize,
    /// Clips of music danced to in each repeat.
    pub clips: usize,
    /// Threads to train with.
    pub threads: Option<usize>,
    /// Print only errors and the table.
    pub quiet: bool,
}

/// A mean and half the width of its 95 % interval.
type Figure = (f64, f64);

/// What a variant reached.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The variant.
    pub name: String,
    /// What differs from the whole model.
    pub what: String,
    /// Likelihood of held-out codes, nats a frame, at its best line; between
    /// variants with other codes it says nothing.
    pub nll: f64,
    /// How much worse that gets with another clip's music: does it listen?
    pub nll_for_music: f64,
    /// Scores of its dances.
    pub scores: RowScores,
}

/// Figures of [`Evaluation`]: mean and 95 % interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)] // as in `Evaluation`
pub struct RowScores {
    pub mpjpe_mm: Figure,
    pub codes_used: Figure,
    pub fact: Figure,
    pub f1: Figure,
    pub f1_silence: Figure,
    pub fid_k: Figure,
    pub fid_g: Figure,
    pub dist_k: Figure,
    pub dist_g: Figure,
    pub jerk: Figure,
}

/// Trains and scores every variant. `None` if `stop` was set on the way.
///
/// # Errors
/// Settings or data that cannot be used, a variant that does not exist.
pub fn ablate(request: &Request, stop: &AtomicBool) -> anyhow::Result<Option<Table>> {
    let chosen = chosen(request)?;
    let name = request.config.display();
    let whole =
        std::fs::read_to_string(&request.config).with_context(|| format!("cannot read {name}"))?;
    let planned: Vec<(&Variant, String)> = chosen
        .into_iter()
        .map(|variant| Ok((variant, checked_settings(variant, &whole)?)))
        .collect::<anyhow::Result<_>>()
        .with_context(|| name.to_string())?;
    let mut rows = Vec::with_capacity(planned.len());
    for (variant, settings) in planned {
        let folder = request.out.join(variant.name);
        let told = folder.join("figures.json");
        let row = match std::fs::read(&told) {
            Ok(bytes) => serde_json::from_slice(&bytes)
                .with_context(|| format!("{} is not what ablate wrote", told.display()))?,
            Err(_) => match one(request, variant, &settings, &folder, stop)? {
                None => return Ok(None),
                Some(row) => {
                    write_whole(&told, &serde_json::to_vec_pretty(&row)?)?;
                    row
                }
            },
        };
        rows.push(row);
    }
    let table = Table { rows };
    write_whole(&request.out.join("ablation.csv"), table.csv().as_bytes())?;
    write_whole(&request.out.join("ablation.png"), &table.picture().png()?)?;
    Ok(Some(table))
}

/// Refused before anything is trained.
fn checked_settings(variant: &Variant, whole: &str) -> anyhow::Result<String> {
    let settings = variant.settings(whole)?;
    let file: SettingsFile = toml::from_str(&settings)?;
    for stage in [StageKind::VqVae, StageKind::MotionSeq] {
        file.resolve(stage)?;
    }
    Ok(settings)
}

fn chosen(request: &Request) -> anyhow::Result<Vec<&'static Variant>> {
    let names = || VARIANTS.iter().map(|variant| variant.name);
    for asked in &request.only {
        if !names().any(|name| name == asked) {
            let known = names().collect::<Vec<_>>().join(", ");
            anyhow::bail!("no variant is called `{asked}`; there are {known}");
        }
    }
    let wanted = |variant: &&Variant| {
        let asked = request.only.iter().any(|name| name == variant.name);
        variant.name == VARIANTS[0].name
            || asked
            || request.only.is_empty() && (!variant.latents || request.latents.is_some())
    };
    let chosen: Vec<&Variant> = VARIANTS.iter().filter(wanted).collect();
    if chosen.iter().any(|variant| variant.latents) && request.latents.is_none() {
        anyhow::bail!(
            "`encodec` needs --latents: the same data by `servodance dataset build --music-features encodec128`"
        );
    }
    Ok(chosen)
}

/// Trains both stages of a variant and scores it.
fn one(
    request: &Request,
    variant: &Variant,
    settings: &str,
    folder: &Path,
    stop: &AtomicBool,
) -> anyhow::Result<Option<Row>> {
    let progress = Progress::share("training", request.quiet);
    progress.note(&format!("{}: {}", variant.name, variant.what));
    progress.done();
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let config = folder.join("train.toml");
    write_whole(&config, settings.as_bytes())?;
    let data = data(request, variant);
    let codes_of = match variant.own_codes {
        true => folder.to_owned(),
        false => request.out.join(VARIANTS[0].name),
    };
    let stages = [
        (StageKind::VqVae, variant.own_codes, &request.data),
        (StageKind::MotionSeq, true, data),
    ];
    for (stage, needed, data) in stages {
        if !needed {
            continue;
        }
        let begun = folder.join(stage.name()).join("last.safetensors").exists();
        train(
            &runs::Request {
                stage,
                config: config.clone(),
                data: Some(data.clone()),
                out: Some(folder.to_owned()),
                stage_one: Some(codes_of.join("vqvae/weights.safetensors")),
                seed: None,
                threads: request.threads,
                until: None,
                resume: begun,
                quiet: request.quiet,
            },
            stop,
        )?;
        if stop.load(Ordering::Acquire) {
            return Ok(None);
        }
    }
    let (nll, wrong) = best_line(&folder.join("motionseq/curves.csv"))?;
    let scores = scored(request, variant, folder)?;
    Ok(Some(Row {
        name: variant.name.into(),
        what: variant.what.into(),
        nll,
        nll_for_music: wrong - nll,
        scores,
    }))
}

/// What a variant learns from and is scored on.
fn data<'a>(request: &'a Request, variant: &Variant) -> &'a PathBuf {
    let latents = request.latents.as_ref().filter(|_| variant.latents);
    latents.unwrap_or(&request.data)
}

fn scored(request: &Request, variant: &Variant, folder: &Path) -> anyhow::Result<RowScores> {
    let progress = Progress::share("evaluating", request.quiet);
    let found = evaluate(
        &evaluate::Request {
            data: Some(data(request, variant).clone()),
            encodec: request.encodec.clone().filter(|_| variant.latents),
            texts: None,
            extractors: None,
            model: Some(folder.join("motionseq/weights.safetensors")),
            style: variant.style.map(str::to_owned),
            repeats: request.repeats,
            clips: request.clips,
            seconds: 20.0,
            minutes: 0,
            sampling: GeneratorOptions::default(),
            engine: EngineOptions::default(),
            seed: 1,
        },
        |share| progress.at(100.0 * share),
    )?;
    progress.done();
    Ok(RowScores::from(&found))
}

impl From<&Evaluation> for RowScores {
    fn from(found: &Evaluation) -> Self {
        let figure = |estimate: evaluate::Estimate| (estimate.mean, estimate.ci95);
        Self {
            mpjpe_mm: figure(found.mpjpe_mm),
            codes_used: figure(found.codes_used),
            fact: figure(found.beat.own.fact),
            f1: figure(found.beat.own.f1),
            f1_silence: figure(found.beat.silence),
            fid_k: figure(found.fid_k),
            fid_g: figure(found.fid_g),
            dist_k: figure(found.dist_k),
            dist_g: figure(found.dist_g),
            jerk: figure(found.jerk),
        }
    }
}

/// `val_nll` and `wrong_nll` of the line with the best `val_nll`: that of the
/// weights that were kept. Not a number where no clips were held out.
fn best_line(csv: &Path) -> anyhow::Result<(f64, f64)> {
    let text =
        std::fs::read_to_string(csv).with_context(|| format!("cannot read {}", csv.display()))?;
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let column = |name: &str| header.iter().position(|column| *column == name);
    let (Some(nll), Some(wrong)) = (column("val_nll"), column("wrong_nll")) else {
        return Ok((f64::NAN, f64::NAN));
    };
    let number = |fields: &[&str], at: usize| {
        let field = fields.get(at).copied().unwrap_or_default();
        field.parse().unwrap_or(f64::NAN)
    };
    let lines = lines.map(|line| {
        let fields: Vec<&str> = line.split(',').collect();
        (number(&fields, nll), number(&fields, wrong))
    });
    let finite = lines.filter(|line| line.0.is_finite());
    let best = finite.min_by(|a, b| a.0.total_cmp(&b.0));
    Ok(best.unwrap_or((f64::NAN, f64::NAN)))
}
