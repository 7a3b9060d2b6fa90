//! What a training run is asked for: read from a file, filled up from the
//! preset, checked before anything else happens.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::codebook::CodebookSettings;
use super::error::TrainError;
use super::motion_loss::LossWeights;
use servodance_model::conditioning::MusicKind;
use servodance_model::config::{ModelConfig, PRESETS, Positions};

/// Which stage is trained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum StageKind {
    /// Stage 1: motion to codes and back.
    VqVae,
    /// Stage 2: the next codes.
    MotionSeq,
}

impl StageKind {
    /// Its name in commands, files and folders.
    pub fn name(self) -> &'static str {
        match self {
            StageKind::VqVae => "vqvae",
            StageKind::MotionSeq => "motionseq",
        }
    }
}

/// The sizes to train, by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// What ships.
    #[default]
    Live,
    /// The sizes of the MAGMA paper.
    Paper,
    /// For tests.
    Tiny,
}

impl Preset {
    fn name(self) -> &'static str {
        match self {
            Preset::Live => PRESETS[0],
            Preset::Paper => PRESETS[1],
            Preset::Tiny => PRESETS[2],
        }
    }
}

/// Where the sizes depart from the preset; what is left out stays.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ModelChanges {
    /// Body parts with a codebook each.
    pub parts: Option<Vec<String>>,
    /// Codes in a codebook.
    pub codes: Option<usize>,
    /// The music features that stage 2 hears.
    pub music: Option<MusicKind>,
    /// `alibi` or `sinusoidal`.
    pub positions: Option<Positions>,
    /// Whether sequences end.
    pub eos: Option<bool>,
    /// Whether music is heard in its order and time.
    pub cross_aligned: Option<bool>,
    /// Music frames seen ahead.
    pub lookahead: Option<usize>,
    /// Frames that MotionSeq sees.
    pub window: Option<usize>,
}

/// How one stage is trained, as the file says it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StageFile {
    /// Steps of the whole run; the learning rate falls towards its end.
    pub steps: Option<u64>,
    /// Sequences a step.
    pub batch: Option<usize>,
    /// Frames of a sequence at most.
    pub length: Option<usize>,
    /// Frames at least: each sequence has its own length between the two.
    pub min_length: Option<usize>,
    /// The highest learning rate.
    pub learning_rate: Option<f64>,
    /// Steps until it is reached.
    pub warm_up: Option<u64>,
    /// How much matrices shrink, times the learning rate.
    pub weight_decay: Option<f32>,
    /// The longest gradient that is let through as it is.
    pub clip: Option<f32>,
    /// Share of channels dropped.
    pub dropout: Option<f32>,
    /// Steps between lines of the curves, each with a validation.
    pub report: Option<u64>,
    /// Steps between checkpoints.
    pub checkpoint: Option<u64>,
    /// Validations without an improvement before it ends early; 0 never.
    pub patience: Option<u64>,
}

/// How one stage is trained.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageSettings {
    /// Steps of the whole run.
    pub steps: u64,
    /// Sequences a step.
    pub batch: usize,
    /// Frames of a sequence at most.
    pub length: usize,
    /// Frames at least.
    pub min_length: usize,
    /// The highest learning rate.
    pub learning_rate: f64,
    /// Steps until it is reached.
    pub warm_up: u64,
    /// How much matrices shrink.
    pub weight_decay: f32,
    /// The longest gradient.
    pub clip: f32,
    /// Share of channels dropped.
    pub dropout: f32,
    /// Steps between lines of the curves.
    pub report: u64,
    /// Steps between checkpoints; may change when a run goes on.
    #[serde(skip)]
    pub checkpoint: u64,
    /// Validations without an improvement; may change when a run goes on.
    #[serde(skip)]
    pub patience: u64,
}

/// How often clips are shown, beside dance with music, which counts 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClipWeights {
    /// Clips that are no dance.
    pub other: f64,
    /// Choreography.
    pub synthetic: f64,
    /// Clips without music.
    pub silent: f64,
    /// 0: styles count by their minutes; 1: all alike.
    pub balance: f64,
}

impl Default for ClipWeights {
    fn default() -> Self {
        Self {
            other: 0.4,
            synthetic: 0.5,
            silent: 1.0,
            balance: 0.0,
        }
    }
}

/// What keeps stage 1 from relying on exact codes.
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
        Self {
            free_steps: 300,
            noise: 0.05,
        }
    }
}

/// What stage 2 is shown in place of the truth, so that it survives its own
/// mistakes and listens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TokenSettings {
    /// Mean share of past codes replaced.
    pub noise: f32,
    /// Share of sequences whose past runs off the music's clock.
    pub shake: f32,
    /// Share of sequences without timbre and chroma.
    pub veil: f32,
    /// Share of sequences without music: classifier-free guidance needs them.
    pub music_drop: f32,
    /// Share of sequences without style.
    pub style_drop: f32,
    /// Label smoothing.
    pub smoothing: f32,
}

impl Default for TokenSettings {
    fn default() -> Self {
        Self {
            noise: 0.08,
            shake: 0.6,
            veil: 0.8,
            music_drop: 0.1,
            style_drop: 0.15,
            smoothing: 0.0,
        }
    }
}

/// Everything that the numbers of a run follow from, beside its data.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// The stage.
    pub stage: StageKind,
    /// Sizes.
    pub model: ModelConfig,
    /// How it is trained.
    pub run: StageSettings,
    /// How often clips are shown.
    pub clips: ClipWeights,
    /// Stage 1: terms of the loss.
    pub loss: LossWeights,
    /// Stage 1: codebooks.
    pub codebook: CodebookSettings,
    /// Stage 1: quantisation.
    pub quantise: QuantiseSettings,
    /// Stage 2: what is shown in place of the truth.
    pub tokens: TokenSettings,
    /// Everything random follows from it.
    pub seed: u64,
}

/// The file's part of the settings.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SettingsFile {
    /// The training file, as `servodance dataset build` writes it.
    pub data: Option<PathBuf>,
    /// The folder to write to; each stage has a folder of its own in it.
    pub out: Option<PathBuf>,
    /// The weights of stage 1 that stage 2 builds on; those in `out` if left out.
    pub stage_one: Option<PathBuf>,
    /// Threads to work with; as many as the machine has if left out.
    pub threads: Option<usize>,
    /// The sizes to train.
    pub preset: Preset,
    /// Where they depart from it.
    pub model: ModelChanges,
    /// Everything random follows from it; 1 if left out.
    pub seed: Option<u64>,
    /// Stage 1.
    pub vqvae: StageFile,
    /// Stage 2.
    pub motionseq: StageFile,
    /// How often clips are shown.
    pub clips: ClipWeights,
    /// Stage 1: terms of the loss.
    pub loss: LossWeights,
    /// Stage 1: codebooks.
    pub codebook: CodebookSettings,
    /// Stage 1: quantisation.
    pub quantise: QuantiseSettings,
    /// Stage 2: what is shown in place of the truth.
    pub tokens: TokenSettings,
}

impl SettingsFile {
    /// Fills up from the preset and checks; the error names the setting, what
    /// it is and what it may be.
    pub fn resolve(&self, stage: StageKind) -> Result<Settings, TrainError> {
        let file = match stage {
            StageKind::VqVae => &self.vqvae,
            StageKind::MotionSeq => &self.motionseq,
        };
        let settings = Settings {
            stage,
            model: self.sizes()?,
            run: filled(file, defaults(self.preset, stage)),
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
        let unknown = || TrainError::Settings(format!("unknown preset `{}`", self.preset.name()));
        let mut config = ModelConfig::preset(self.preset.name()).ok_or_else(unknown)?;
        config.seq.styles = crate::motion::index::STYLES.map(str::to_owned).to_vec();
        let change = &self.model;
        set(&mut config.parts, &change.parts);
        set(&mut config.codes, &change.codes);
        set(&mut config.music, &change.music);
        config.music_dim = config.music.dim();
        self.apply_to_seq(&mut config);
        let text =
            serde_json::to_string(&config).map_err(|e| TrainError::Settings(e.to_string()))?;
        ModelConfig::from_json(&text).map_err(|e| TrainError::Settings(format!("model: {e}")))
    }

    fn apply_to_seq(&self, config: &mut ModelConfig) {
        let (seq, change) = (&mut config.seq, &self.model);
        set(&mut seq.positions, &change.positions);
        set(&mut seq.eos, &change.eos);
        set(&mut seq.cross_aligned, &change.cross_aligned);
        set(&mut seq.lookahead, &change.lookahead);
        set(&mut seq.window, &change.window);
    }
}

fn set<T: Clone>(to: &mut T, from: &Option<T>) {
    if let Some(value) = from {
        to.clone_from(value);
    }
}

fn defaults(preset: Preset, stage: StageKind) -> StageSettings {
    let vq = stage == StageKind::VqVae;
    let live = StageSettings {
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
        Preset::Paper => StageSettings {
            steps: if vq { 300_000 } else { 200_000 },
            batch: if vq { 128 } else { 64 },
            learning_rate: 2e-4,
            warm_up: 5000,
            report: 1000,
            checkpoint: 1000,
            ..live
        },
        Preset::Tiny => StageSettings {
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

fn filled(file: &StageFile, mut run: StageSettings) -> StageSettings {
    if file.min_length.is_none() && file.length.is_some() {
        run.min_length = file.length.unwrap_or(run.min_length);
    }
    set(&mut run.steps, &file.steps);
    set(&mut run.batch, &file.batch);
    set(&mut run.length, &file.length);
    set(&mut run.min_length, &file.min_length);
    set(&mut run.learning_rate, &file.learning_rate);
    set(&mut run.warm_up, &file.warm_up);
    set(&mut run.weight_decay, &file.weight_decay);
    set(&mut run.clip, &file.clip);
    set(&mut run.dropout, &file.dropout);
    set(&mut run.report, &file.report);
    set(&mut run.checkpoint, &file.checkpoint);
    set(&mut run.patience, &file.patience);
    run
}

impl Settings {
    fn check(&self) -> Result<(), String> {
        let (run, stage) = (&self.run, self.stage.name());
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
                return Err(format!(
                    "{stage}.{name} is {value}, expected {low} to {high}"
                ));
            }
        }
        let (loss, tokens) = (&self.loss, &self.tokens);
        let shares = [
            (format!("{stage}.dropout"), run.dropout, 0.9),
            ("codebook.decay".into(), self.codebook.decay, 0.9999),
            ("quantise.noise".into(), self.quantise.noise, 1.0),
            ("tokens.noise".into(), tokens.noise, 0.5),
            ("tokens.shake".into(), tokens.shake, 1.0),
            ("tokens.veil".into(), tokens.veil, 1.0),
            ("tokens.music_drop".into(), tokens.music_drop, 1.0),
            ("tokens.style_drop".into(), tokens.style_drop, 1.0),
            ("tokens.smoothing".into(), tokens.smoothing, 0.9),
            (format!("{stage}.weight_decay"), run.weight_decay, 10.0),
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
                "{stage}.learning_rate is {}, expected 0 to 1",
                run.learning_rate
            ));
        }
        if !(run.clip > 0.0 && run.clip.is_finite()) {
            return Err(format!(
                "{stage}.clip is {}, expected more than 0",
                run.clip
            ));
        }
        Ok(())
    }
}
