//! What a training run is asked for: read from a file, filled up from the
//! preset, checked before anything else happens.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::error::TrainError;
use crate::train::vqvae::codebook::CodebookSettings;
use crate::train::vqvae::loss::LossWeights;
use servodance_model::conditioning::MusicKind;
use servodance_model::config::{EncoderKind, ModelConfig, PRESETS, Positions};

/// The network that a run trains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum TrainedNetwork {
    /// The VQ-VAE: motion to codes and back.
    VqVae,
    /// The transformer that predicts the next codes.
    MotionSeq,
}

impl TrainedNetwork {
    /// Its name in commands, files and folders.
    pub fn name(self) -> &'static str {
        ["vqvae", "motionseq"][self as usize]
    }
}

/// Sizes and step counts to start from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)] // explained in docs/training.md
pub enum Preset {
    #[default]
    Live,
    /// The sizes of the MAGMA paper.
    Paper,
    Tiny,
}

/// Where the sizes depart from the preset; what is left out stays.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)] // docs/training.md has a table of them
pub struct ModelChanges {
    pub parts: Option<Vec<String>>,
    pub codes: Option<usize>,
    /// Numbers of a code.
    pub code_dim: Option<usize>,
    /// Codebooks of each part.
    pub levels: Option<Vec<usize>>,
    /// What is quantised.
    pub encoder: Option<EncoderKind>,
    /// Whether encoders and decoder add a linear map of their input.
    pub skip: Option<bool>,
    pub music: Option<MusicKind>,
    pub positions: Option<Positions>,
    pub eos: Option<bool>,
    /// Whether music is heard in its order and time.
    pub cross_aligned: Option<bool>,
    /// Music frames seen ahead.
    pub lookahead: Option<usize>,
    pub window: Option<usize>,
}

/// Declares the settings of a run, and their optional form as the file gives them.
macro_rules! run_settings {
    ($($(#[$meta:meta])* $name:ident: $type:ty,)*) => {
        /// How one network is trained; what is left out follows from the preset.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields, default)]
        #[allow(missing_docs)] // docs/training.md has a table of them
        pub struct RunOverrides {
            $(pub $name: Option<$type>,)*
        }

        /// How one network is trained, with nothing left out.
        #[derive(Clone, Debug, PartialEq, Serialize)]
        #[allow(missing_docs)] // docs/training.md has a table of them
        pub struct RunSettings {
            $($(#[$meta])* pub $name: $type,)*
        }

        impl RunOverrides {
            fn apply(&self, run: &mut RunSettings) {
                $(set(&mut run.$name, &self.$name);)*
            }
        }
    };
}

run_settings! {
    /// Steps of the whole run; the learning rate falls towards its end.
    steps: u64,
    batch: usize,
    length: usize,
    /// Frames at least: each sequence has its own length between the two.
    min_length: usize,
    learning_rate: f64,
    /// Steps until the highest learning rate is reached.
    warm_up: u64,
    /// How much matrices shrink in a step, times the learning rate.
    weight_decay: f32,
    /// The longest gradient that is let through as it is.
    clip: f32,
    dropout: f32,
    /// Steps between lines of the curves, each with a validation.
    report: u64,
    /// Steps between checkpoints; may change when a run goes on.
    #[serde(skip)]
    checkpoint: u64,
    /// Validations without improvement before the run ends, 0 for never; may change on resuming.
    #[serde(skip)]
    patience: u64,
}

/// How often clips are shown, beside dance with music, which counts 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)] // docs/training.md has a table of them
pub struct ClipWeights {
    pub other: f64,
    pub synthetic: f64,
    pub silent: f64,
    /// 0: styles count by their minutes; 1: all alike.
    pub balance: f64,
}

impl Default for ClipWeights {
    fn default() -> Self {
        Self { other: 0.4, synthetic: 0.5, silent: 1.0, balance: 0.0 }
    }
}

/// What keeps the VQ-VAE from relying on exact codes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct QuantiseSettings {
    /// Steps before codes are used at all.
    pub free_steps: u64,
    /// Share of codes replaced by one of their nearest eight.
    pub noise: f32,
}

impl Default for QuantiseSettings {
    fn default() -> Self {
        Self { free_steps: 300, noise: 0.05 }
    }
}

/// What MotionSeq is shown in place of the truth, so that it survives its own mistakes and listens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)] // docs/training.md has a table of them
pub struct TokenSettings {
    /// Mean share of past codes replaced.
    pub noise: f32,
    /// Share of sequences whose past runs off the music's clock.
    #[serde(rename = "shake")]
    pub beat_jitter: f32,
    /// Share of sequences without timbre and chroma.
    #[serde(rename = "veil")]
    pub feature_dropout: f32,
    /// Share of sequences without music: classifier-free guidance needs them.
    pub music_drop: f32,
    /// Share of sequences without style.
    pub style_drop: f32,
    pub smoothing: f32,
}

impl Default for TokenSettings {
    fn default() -> Self {
        Self {
            noise: 0.08,
            beat_jitter: 0.6,
            feature_dropout: 0.8,
            music_drop: 0.1,
            style_drop: 0.15,
            smoothing: 0.0,
        }
    }
}

/// Everything that the numbers of a run follow from, beside its data.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs)] // docs/training.md has a table of them
pub struct TrainingSettings {
    #[serde(rename = "stage")] // the key in checkpoints
    pub network: TrainedNetwork,
    pub model: ModelConfig,
    pub run: RunSettings,
    pub clips: ClipWeights,
    pub loss: LossWeights,
    pub codebook: CodebookSettings,
    pub quantise: QuantiseSettings,
    /// MotionSeq: what is shown in place of the truth.
    pub tokens: TokenSettings,
    pub seed: u64,
}

/// The settings file as it is written.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)] // docs/training.md has a table of them
pub struct SettingsFile {
    /// The training file, as `servodance dataset build` writes it.
    pub data: Option<PathBuf>,
    /// The folder to write to; each network has a folder of its own in it.
    pub out: Option<PathBuf>,
    /// The weights of the VQ-VAE that MotionSeq builds on (those in `out` if left out), or that
    /// another VQ-VAE begins with.
    #[serde(rename = "stage_one")]
    pub vqvae_weights: Option<PathBuf>,
    /// Threads to work with; as many as the machine has if left out.
    pub threads: Option<usize>,
    pub preset: Preset,
    pub model: ModelChanges,
    /// Everything random follows from it; 1 if left out.
    pub seed: Option<u64>,
    pub vqvae: RunOverrides,
    pub motionseq: RunOverrides,
    pub clips: ClipWeights,
    pub loss: LossWeights,
    pub codebook: CodebookSettings,
    pub quantise: QuantiseSettings,
    /// MotionSeq: what is shown in place of the truth.
    pub tokens: TokenSettings,
}

impl SettingsFile {
    /// Fills up from the preset. Fails with the setting, its value and its range.
    pub fn resolve(&self, network: TrainedNetwork) -> Result<TrainingSettings, TrainError> {
        let file = match network {
            TrainedNetwork::VqVae => &self.vqvae,
            TrainedNetwork::MotionSeq => &self.motionseq,
        };
        let settings = TrainingSettings {
            network,
            model: self.sizes()?,
            run: filled(file, defaults(self.preset, network)),
            clips: self.clips.clone(),
            loss: self.loss,
            codebook: self.codebook,
            quantise: self.quantise.clone(),
            tokens: self.tokens.clone(),
            seed: self.seed.unwrap_or(1),
        };
        settings.check().map_err(TrainError::Settings)?;
        Ok(settings)
    }

    fn sizes(&self) -> Result<ModelConfig, TrainError> {
        let preset = PRESETS[self.preset as usize];
        let unknown = || TrainError::Settings(format!("unknown preset `{preset}`"));
        let mut config = ModelConfig::preset(preset).ok_or_else(unknown)?;
        config.seq.styles = crate::dataset::styles::STYLES.map(str::to_owned).to_vec();
        let change = &self.model;
        if change.parts.is_some() {
            config.levels.clear(); // they were those of other parts
        }
        set(&mut config.parts, &change.parts);
        set(&mut config.codes, &change.codes);
        set(&mut config.levels, &change.levels);
        set(&mut config.code_dim, &change.code_dim);
        set(&mut config.vq.encoder, &change.encoder);
        set(&mut config.vq.skip, &change.skip);
        set(&mut config.music, &change.music);
        config.music_dim = config.music.dim();
        let seq = &mut config.seq;
        set(&mut seq.positions, &change.positions);
        set(&mut seq.eos, &change.eos);
        set(&mut seq.cross_aligned, &change.cross_aligned);
        set(&mut seq.lookahead, &change.lookahead);
        set(&mut seq.window, &change.window);
        let text =
            serde_json::to_string(&config).map_err(|e| TrainError::Settings(e.to_string()))?;
        ModelConfig::from_json(&text).map_err(|e| TrainError::Settings(format!("model: {e}")))
    }
}

fn set<T: Clone>(to: &mut T, from: &Option<T>) {
    if let Some(value) = from {
        to.clone_from(value);
    }
}

fn defaults(preset: Preset, network: TrainedNetwork) -> RunSettings {
    let vq = network == TrainedNetwork::VqVae;
    let live = RunSettings {
        steps: if vq { 4000 } else { 5000 },
        batch: if vq { 32 } else { 16 },
        length: if vq { 96 } else { 240 },
        min_length: if vq { 96 } else { 240 },
        learning_rate: 1e-3,
        warm_up: 200,
        weight_decay: 0.01,
        clip: 1.0,
        dropout: 0.0,
        report: 100,
        checkpoint: 200,
        patience: 0,
    };
    match preset {
        Preset::Live => live,
        Preset::Paper => RunSettings {
            steps: if vq { 300_000 } else { 200_000 },
            batch: if vq { 128 } else { 64 },
            learning_rate: 2e-4,
            warm_up: 5000,
            report: 1000,
            checkpoint: 1000,
            ..live
        },
        Preset::Tiny => RunSettings {
            steps: 60,
            batch: 4,
            length: 32,
            min_length: 16,
            warm_up: 10,
            report: 20,
            checkpoint: 20,
            ..live
        },
    }
}

fn filled(file: &RunOverrides, mut run: RunSettings) -> RunSettings {
    if let (Some(length), None) = (file.length, file.min_length) {
        run.min_length = length;
    }
    file.apply(&mut run);
    run
}

impl TrainingSettings {
    fn check(&self) -> Result<(), String> {
        let (run, network) = (&self.run, self.network.name());
        let whole = [
            ("steps", run.steps, 1, 100_000_000),
            ("batch", run.batch as u64, 1, 4096),
            ("length", run.length as u64, 4, 4096),
            ("min_length", run.min_length as u64, 4, run.length as u64),
            ("report", run.report, 1, 1_000_000),
            ("checkpoint", run.checkpoint, 1, 1_000_000),
        ];
        for (name, value, low, high) in whole {
            if !(low..=high).contains(&value) {
                return Err(format!("{network}.{name} is {value}, expected {low} to {high}"));
            }
        }
        let (loss, tokens) = (&self.loss, &self.tokens);
        let shares = [
            (format!("{network}.dropout"), run.dropout, 0.9),
            ("codebook.decay".into(), self.codebook.decay, 0.9999),
            ("quantise.noise".into(), self.quantise.noise, 1.0),
            ("tokens.noise".into(), tokens.noise, 0.5),
            ("tokens.shake".into(), tokens.beat_jitter, 1.0),
            ("tokens.veil".into(), tokens.feature_dropout, 1.0),
            ("tokens.music_drop".into(), tokens.music_drop, 1.0),
            ("tokens.style_drop".into(), tokens.style_drop, 1.0),
            ("tokens.smoothing".into(), tokens.smoothing, 0.9),
            (format!("{network}.weight_decay"), run.weight_decay, 10.0),
            ("codebook.dead_below".into(), self.codebook.dead_below, 1e6),
            ("loss.position".into(), loss.position, 1e6),
            ("loss.velocity".into(), loss.velocity, 1e6),
            ("loss.slide".into(), loss.slide, 1e6),
            ("loss.jerk".into(), loss.jerk, 1e6),
            ("loss.commit".into(), loss.commit, 1e6),
            ("clips.other".into(), self.clips.other as f32, 1e6),
            ("clips.synthetic".into(), self.clips.synthetic as f32, 1e6),
            ("clips.silent".into(), self.clips.silent as f32, 1e6),
            ("clips.balance".into(), self.clips.balance as f32, 1.0),
        ];
        for (name, value, high) in shares {
            if !(0.0..=high).contains(&value) {
                return Err(format!("{name} is {value}, expected 0 to {high}"));
            }
        }
        if !(run.learning_rate > 0.0 && run.learning_rate <= 1.0) {
            return Err(format!(
                "{network}.learning_rate is {}, expected 0 to 1",
                run.learning_rate
            ));
        }
        if !(run.clip > 0.0 && run.clip.is_finite()) {
            return Err(format!("{network}.clip is {}, expected more than 0", run.clip));
        }
        Ok(())
    }
}
