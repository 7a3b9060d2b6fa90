//! What each part of the model is good for: it is trained without that part, on
//! the same data for as many steps, and scored like the whole (the MAGMA
//! paper's Table 3 in kind).
//!
//! Every variant has a folder with its settings, curves and weights, which
//! `servodance train` and `evaluate` understand as well. A run that was stopped
//! goes on where it stood. Small budgets rank variants, they do not measure them:
//! intervals are over dances, not over trainings.

mod row;
mod table;
mod variant;

use crate::evaluate::{self, evaluate};
use crate::runs::curves::CurveFile;
use crate::runs::{self, train};
use crate::train::{SettingsFile, TrainedNetwork};
use anyhow::Context;
use row::{AblationRow, AblationScores};
use servodance_runtime::pipeline::model_args::{EngineArgs, SamplingArgs};
use servodance_runtime::process::number_range::within;
use servodance_runtime::process::progress::Progress;
use servodance_runtime::telemetry::pending_file::write_whole;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use table::AblationTable;
use variant::{AblationVariant, VARIANTS};

/// What an ablation trains, on which data, and where it writes.
#[derive(Clone, Debug, clap::Args)]
pub struct AblationRequest {
    /// Settings of the whole model.
    #[arg(long, value_name = "FILE.toml")]
    pub config: PathBuf,
    /// The training file
    #[arg(long, value_name = "FILE.safetensors")]
    pub data: PathBuf,
    /// The same built with `--music-features encodec128`, for the variant
    /// that hears Encodec latents.
    #[arg(long, value_name = "FILE.safetensors")]
    pub latents: Option<PathBuf>,
    /// The Encodec that these latents are of, if it is not in
    /// servodance/encodec_24khz in the user's data folder.
    #[arg(long, value_name = "FILE.safetensors", requires = "latents")]
    pub encodec: Option<PathBuf>,
    /// The folder to write to; a run that was stopped there goes on.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Only this variant beside the whole model; may be given several times.
    #[arg(long, value_name = "VARIANT")]
    pub only: Vec<String>,
    /// How often everything is danced anew.
    #[arg(long, default_value_t = 5, value_name = "N", value_parser = within(2..=1000_usize))]
    pub repeats: usize,
    /// Clips of music danced to in each repeat.
    #[arg(long, default_value_t = 8, value_name = "N", value_parser = within(2..=1000_usize))]
    pub clips: usize,
    /// Threads to train with.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Print only errors and the table.
    #[arg(long, short)]
    pub quiet: bool,
}

/// Trains and scores every variant. `None` if `stop` was set on the way. Fails on settings or
/// data that cannot be used, a variant that does not exist.
pub fn ablate(
    request: &AblationRequest,
    stop: &AtomicBool,
) -> anyhow::Result<Option<AblationTable>> {
    let chosen = chosen_variants(request)?;
    let name = request.config.display();
    let whole =
        std::fs::read_to_string(&request.config).with_context(|| format!("cannot read {name}"))?;
    let planned: Vec<(&AblationVariant, String)> = chosen
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
            Err(_) => match train_and_score(request, variant, &settings, &folder, stop)? {
                None => return Ok(None),
                Some(row) => {
                    let bytes = serde_json::to_vec_pretty(&row)?;
                    write_whole(&told, &bytes)?;
                    // As another run will read it: JSON may cost a figure its last bit.
                    serde_json::from_slice(&bytes)?
                }
            },
        };
        rows.push(row);
    }
    let table = AblationTable { rows };
    write_whole(&request.out.join("ablation.csv"), table.csv().as_bytes())?;
    write_whole(&request.out.join("ablation.png"), &table.picture().png()?)?;
    Ok(Some(table))
}

fn checked_settings(variant: &AblationVariant, whole: &str) -> anyhow::Result<String> {
    let settings = variant.settings(whole)?;
    let file: SettingsFile = toml::from_str(&settings)?;
    for network in [TrainedNetwork::VqVae, TrainedNetwork::MotionSeq] {
        file.resolve(network)?;
    }
    Ok(settings)
}

fn chosen_variants(request: &AblationRequest) -> anyhow::Result<Vec<&'static AblationVariant>> {
    let names = || VARIANTS.iter().map(|variant| variant.name);
    for asked in &request.only {
        if !names().any(|name| name == asked) {
            let known = names().collect::<Vec<_>>().join(", ");
            anyhow::bail!("no variant is called `{asked}`; there are {known}");
        }
    }
    let wanted = |variant: &&AblationVariant| {
        let asked = request.only.iter().any(|name| name == variant.name);
        variant.name == VARIANTS[0].name
            || asked
            || request.only.is_empty() && (!variant.latents || request.latents.is_some())
    };
    let chosen: Vec<&AblationVariant> = VARIANTS.iter().filter(wanted).collect();
    if chosen.iter().any(|variant| variant.latents) && request.latents.is_none() {
        anyhow::bail!(
            "`encodec` needs --latents: the same data by `servodance dataset build --music-features encodec128`"
        );
    }
    Ok(chosen)
}

fn train_and_score(
    request: &AblationRequest,
    variant: &AblationVariant,
    settings: &str,
    folder: &Path,
    stop: &AtomicBool,
) -> anyhow::Result<Option<AblationRow>> {
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
    let networks = [
        (TrainedNetwork::VqVae, variant.own_codes, &request.data),
        (TrainedNetwork::MotionSeq, true, data),
    ];
    for (network, needed, data) in networks {
        if !needed {
            continue;
        }
        let builds_on = network == TrainedNetwork::MotionSeq;
        let begun = folder.join(network.name()).join("last.safetensors").exists();
        train(
            &runs::TrainingRequest {
                network,
                config: config.clone(),
                data: Some(data.clone()),
                out: Some(folder.to_owned()),
                vqvae_weights: builds_on.then(|| codes_of.join("vqvae/weights.safetensors")),
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
    let curves = CurveFile::finished(&folder.join("motionseq"), TrainedNetwork::MotionSeq)?;
    // The line of the weights that were kept.
    let [nll, wrong] = curves.best("val_nll", ["val_nll", "wrong_nll"]);
    let scores = scores_of(request, variant, folder)?;
    Ok(Some(AblationRow {
        name: variant.name.into(),
        what: variant.what.into(),
        nll,
        nll_for_music: wrong - nll,
        scores,
    }))
}

fn data<'a>(request: &'a AblationRequest, variant: &AblationVariant) -> &'a PathBuf {
    let latents = request.latents.as_ref().filter(|_| variant.latents);
    latents.unwrap_or(&request.data)
}

fn scores_of(
    request: &AblationRequest,
    variant: &AblationVariant,
    folder: &Path,
) -> anyhow::Result<AblationScores> {
    let progress = Progress::share("evaluating", request.quiet);
    let found = evaluate(
        &evaluate::EvaluationRequest {
            data: Some(data(request, variant).clone()),
            encodec: request.encodec.clone().filter(|_| variant.latents),
            texts: None,
            extractors: None,
            model: Some(folder.join("motionseq/weights.safetensors")),
            style: variant.style.map(str::to_owned),
            repeats: request.repeats,
            clips: request.clips,
            seconds: Some(20.0),
            minutes: 0,
            by_song: evaluate::SongArgs::default(),
            sampling: SamplingArgs::default(),
            engine: EngineArgs::default(),
            seed: 1,
            json: false,
        },
        |share| progress.at(100.0 * share),
    )?;
    progress.done();
    Ok(AblationScores::from(&found))
}
