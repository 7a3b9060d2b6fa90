//! Music frames in, motion frames out: the whole model behind one `step`.
//!
//! One motion frame per music frame (20 a second), known only from the music
//! up to that frame. Time and memory a frame are constant for any length of
//! music; the same seed, options and music give the same dance. Music that is
//! not finite is replaced by the last good frame and counted. A step allocates
//! nothing, but takes a millisecond: not for a motor control thread.

mod average;
mod code_speeds;
mod dance;
mod floor;
mod likelihood;
mod loudness;
mod motion_size;
mod options;
mod phrases;
mod smooth_motion;
mod speed_by_music;
mod stall;
mod standing_feet;
mod style_by_phrase;

use std::path::Path;
use std::sync::Arc;

use crate::conditioning::{MusicKind, style_index};
use crate::config::ModelConfig;
use crate::engine::{Engine, EngineOptions};
use crate::error::ModelError;
use crate::motion::representation::{POSE_DIM, PoseVector};
use crate::motionseq::MotionSeq;
use crate::sampling::Sampler;
use crate::vqvae::VqDecoder;
use crate::weights::{BUILT_IN, Weights};

use self::code_speeds::CodeSpeeds;
use self::style_by_phrase::StyleByPhrase;
pub use dance::Dance;
pub use likelihood::Likelihood;
pub use options::{AtEnd, GeneratorOptions};
pub use style_by_phrase::MEDLEY;

/// Normalised features are clamped to this many deviations, except the beat.
const MUSIC_CLAMP: f32 = 6.0;

/// Bytes of weights to read at most for the speeds of all codes.
const MOST_MEASURED_BYTES: u64 = 16 << 30;

/// The trained networks; start as many dances from it as you like.
#[derive(Clone, Debug)]
pub struct Generator {
    pub(crate) networks: Arc<Networks>,
}

#[derive(Debug)]
pub(crate) struct Networks {
    config: ModelConfig,
    /// Names of the styles that can be asked for: the network's own, then the medley.
    styles: Vec<String>,
    default_style: usize,
    provenance: String,
    pub(crate) engine: Engine,
    decoder: VqDecoder,
    pub(crate) seq: MotionSeq,
    motion_mean: Vec<f32>,
    motion_std: Vec<f32>,
    music_mean: Vec<f32>,
    music_std: Vec<f32>,
    /// Codes to begin from, and the style each was seen in.
    start_codes: Vec<Vec<usize>>,
    start_styles: Vec<usize>,
    code_speeds: CodeSpeeds,
}

impl Generator {
    /// The weights that ship inside this library (`model/MODEL_CARD.md`).
    pub fn built_in() -> Result<Self, ModelError> {
        Self::from_bytes(BUILT_IN, "built-in weights")
    }

    /// The same, computed otherwise than usual.
    pub fn built_in_with(options: EngineOptions) -> Result<Self, ModelError> {
        Self::from_bytes_with(BUILT_IN, "built-in weights", options)
    }

    /// Loads a weights file and checks every tensor of it.
    pub fn load(path: &Path) -> Result<Self, ModelError> {
        Self::load_with(path, EngineOptions::default())
    }

    /// The same, computed otherwise than usual.
    pub fn load_with(path: &Path, options: EngineOptions) -> Result<Self, ModelError> {
        let source = path.display().to_string();
        Self::from_bytes_with(&Weights::read(path)?, &source, options)
    }

    /// Loads weights from memory; `source` names them in errors.
    pub fn from_bytes(bytes: &[u8], source: &str) -> Result<Self, ModelError> {
        Self::from_bytes_with(bytes, source, EngineOptions::default())
    }

    /// The same, computed otherwise than usual.
    pub fn from_bytes_with(
        bytes: &[u8],
        source: &str,
        options: EngineOptions,
    ) -> Result<Self, ModelError> {
        let w = Weights::open(bytes, source)?;
        let engine = Engine::new(&w, options)?;
        let config = w.config().clone();
        if config.seq.cross_aligned && config.seq.lookahead > 0 {
            return Err(w.config_error(format!(
                "seq.lookahead is {}, expected 0: live music has no future",
                config.seq.lookahead
            )));
        }
        let rows = |name, columns, limit| w.integer_rows(name, columns, limit);
        let start_codes = rows("start.codes", config.codes_a_frame(), config.codes)?;
        let start_styles = rows("start.styles", 1, config.seq.styles.len().max(1))?.concat();
        if start_codes.is_empty() || start_codes.len() != start_styles.len() {
            return Err(w.config_error(format!(
                "`start.codes` has {} rows and `start.styles` {}, expected the same number, not 0",
                start_codes.len(),
                start_styles.len()
            )));
        }
        let mut styles = config.seq.styles.clone();
        let mut default_style = w.default_style();
        if StyleByPhrase::new(&styles).is_some() {
            default_style = styles.len();
            styles.push(MEDLEY.to_owned());
        }
        let mut networks = Networks {
            styles,
            decoder: VqDecoder::load(&w, &engine)?,
            seq: MotionSeq::load(&w, &engine)?,
            engine,
            motion_mean: w.floats("norm.motion_mean", &[POSE_DIM])?,
            motion_std: w.floats("norm.motion_std", &[POSE_DIM])?,
            music_mean: w.floats("norm.music_mean", &[config.music_dim])?,
            music_std: w.floats("norm.music_std", &[config.music_dim])?,
            start_codes,
            start_styles,
            provenance: w.provenance().to_owned(),
            default_style,
            code_speeds: CodeSpeeds::default(),
            config,
        };
        networks.code_speeds = networks.measured_code_speeds()?;
        let networks = Arc::new(networks);
        Ok(Self { networks })
    }

    /// The sizes of the networks.
    pub fn config(&self) -> &ModelConfig {
        &self.networks.config
    }

    /// The music features that the weights were trained to hear.
    pub fn music_kind(&self) -> MusicKind {
        self.networks.config.music
    }

    /// Where the weights came from: data, date, figures (JSON).
    pub fn provenance(&self) -> &str {
        &self.networks.provenance
    }

    /// Names of the styles that a dance can be asked for.
    pub fn styles(&self) -> &[String] {
        &self.networks.styles
    }

    /// The style that is danced when none is asked for.
    pub fn default_style(&self) -> &str {
        &self.styles()[self.networks.default_style]
    }

    /// Where a style stands in [`Generator::styles`].
    /// Fails for: there is none of that name; the message lists those there are.
    pub fn style_index(&self, name: &str) -> Result<usize, ModelError> {
        self.networks.style_index(name)
    }

    /// A new dance. Refuses options out of range and unknown styles.
    pub fn start(&self, options: GeneratorOptions) -> Result<Dance, ModelError> {
        let n = &self.networks;
        let style = match &options.style {
            Some(name) => n.style_index(name)?,
            None => n.default_style,
        };
        options.check(n.config.seq.style_dim)?;
        let sampler = Sampler::new(options.sampling(), options.seed)?;
        Ok(Dance::new(self.networks.clone(), style, sampler, options))
    }
}

impl Networks {
    /// Twenty milliseconds with the built-in weights; none of decoders of the paper's size, which
    /// would take half a minute.
    fn measured_code_speeds(&self) -> Result<CodeSpeeds, ModelError> {
        if self.decoder.bytes() as u64 * self.config.codes as u64 > MOST_MEASURED_BYTES {
            return Ok(CodeSpeeds::default());
        }
        let team = self.engine.pool().team();
        let mut state = self.decoder.start();
        CodeSpeeds::measure(&self.config, |row| {
            state.restart();
            Ok(self.pose_vector(self.decoder.step(&team, &mut state, row)?))
        })
    }

    fn style_index(&self, name: &str) -> Result<usize, ModelError> {
        style_index(&self.styles, name)
    }

    /// The network's own style at this place; that of no style where there is none.
    fn own_style(&self, style: usize) -> usize {
        style.min(self.config.seq.styles.len())
    }

    /// What follows the phrases in a dance of the style at this place.
    fn by_phrase(&self, style: usize) -> Option<StyleByPhrase> {
        let is_medley = self.styles.get(style).is_some_and(|name| name == MEDLEY);
        let own = &self.config.seq.styles;
        is_medley.then(|| StyleByPhrase::new(own)).flatten()
    }

    /// One of the stored beginnings, of this style if there is one.
    fn starting_codes(&self, style: usize, sampler: &mut Sampler) -> Vec<usize> {
        let all: Vec<usize> = (0..self.start_codes.len()).collect();
        let of_style = all.iter().copied().filter(|&i| self.start_styles[i] == style);
        let of_style: Vec<usize> = of_style.collect();
        let pool = if of_style.is_empty() { all } else { of_style };
        self.start_codes[pool[sampler.below(pool.len())]].clone()
    }

    /// The numbers as the network was trained on them, in `music`; false, and
    /// nothing is changed, if one of them is not finite.
    pub fn normalise_music(&self, features: &[f32], music: &mut [f32]) -> bool {
        if features.iter().any(|v| !v.is_finite()) {
            return false;
        }
        let measured = self.config.music.measured();
        for (i, value) in features.iter().enumerate() {
            music[i] = (value - self.music_mean[i]) / self.music_std[i];
            if i < measured {
                music[i] = music[i].clamp(-MUSIC_CLAMP, MUSIC_CLAMP);
            }
        }
        true
    }

    /// Decoder output in metres and radians.
    fn pose_vector(&self, normalised: &[f32]) -> PoseVector {
        std::array::from_fn(|i| normalised[i] * self.motion_std[i] + self.motion_mean[i])
    }
}
