//! Options of every command that runs the model.

use super::conditioning::Conditioning;
use servodance_model::{Dtype, EngineKind, EngineOptions, Generator, GeneratorOptions};
use std::path::PathBuf;

/// A dance that the model invents as the music comes.
#[derive(Clone, Debug, clap::Args)]
pub struct GeneratorArgs {
    /// The same seed and the same input give the same dance.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Dance style; an unknown one lists those that the model knows.
    #[arg(long, value_name = "NAME")]
    pub style: Option<String>,
    /// Weights to use in place of the built-in ones.
    #[arg(long, env = "SERVODANCE_MODEL", value_name = "FILE.safetensors")]
    pub model: Option<PathBuf>,
    /// What weights may need beside them, and a style in words.
    #[command(flatten)]
    pub conditioning: Conditioning,
    /// How the model's steps are computed.
    #[command(flatten)]
    pub engine: EngineArgs,
}

impl GeneratorArgs {
    /// The same for the model. A style that a viewer chose comes before one in words.
    pub fn options(&self, generator: &Generator) -> anyhow::Result<GeneratorOptions> {
        let style_vector = match &self.style {
            Some(_) => None,
            None => self.conditioning.style_vector(generator)?,
        };
        let (seed, style) = (self.seed, self.style.clone());
        Ok(GeneratorOptions { seed, style, style_vector, ..GeneratorOptions::default() })
    }
}

/// How the model's steps are computed.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub struct EngineArgs {
    /// What computes the model's steps: own, or candle (slower; the same codes up to rounding).
    #[arg(long, value_name = "NAME")]
    pub engine: Option<EngineKind>,
    /// Number format of the weights in memory: f32, f16, q8_0, q6 or q4_0; the
    /// file's own if left out.
    #[arg(long, value_name = "FORMAT")]
    pub dtype: Option<Dtype>,
    /// Threads that the model uses.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
}

impl EngineArgs {
    /// The same for the model.
    pub fn options(self) -> EngineOptions {
        EngineOptions {
            kind: self.engine.unwrap_or_default(),
            dtype: self.dtype,
            threads: self.threads,
        }
    }
}

/// How the model's codes are drawn.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub struct SamplingArgs {
    /// How codes are drawn: 0 the likeliest, 1 as the model says, above it wild.
    #[arg(long, value_name = "T")]
    pub temperature: Option<f32>,
    /// Only the K likeliest codes; 0 is all.
    #[arg(long, value_name = "K")]
    pub top_k: Option<usize>,
    /// Only the likeliest codes that hold this share.
    #[arg(long, value_name = "P")]
    pub top_p: Option<f32>,
    /// How much less likely a code gets by its share of the last two seconds: 0
    /// not at all, up to 20; usually 4.
    #[arg(long, value_name = "R")]
    pub repetition: Option<f32>,
    /// How much less likely it gets to dance on as the last time that the dancer
    /// moved like now, of the last half minute: 0 not at all, up to 20; usually 9.
    #[arg(long, value_name = "V")]
    pub variety: Option<f32>,
    /// How much likelier it gets to dance the bar before again within a phrase of the music: 0
    /// not at all, up to 20; usually 3.5.
    #[arg(long, value_name = "B")]
    pub bar_repeat: Option<f32>,
    /// How much larger and faster loud music is danced, smaller and slower soft music: 0 not at
    /// all, up to 2; usually 1.
    #[arg(long, value_name = "D")]
    pub dynamics: Option<f32>,
    /// How much the dance slows down on beats and hurries between them, beyond what the model
    /// learned: 0 not at all, up to 5; usually 0.7.
    #[arg(long, value_name = "E")]
    pub beat_emphasis: Option<f32>,
    /// How much music and style count: 1 as the model says, above it more; usually 1.5.
    #[arg(long, value_name = "G")]
    pub guidance: Option<f32>,
}

impl SamplingArgs {
    /// The same for the model, what is left out as usual.
    pub fn options(self) -> GeneratorOptions {
        let usual = GeneratorOptions::default();
        GeneratorOptions {
            temperature: self.temperature.unwrap_or(usual.temperature),
            top_k: self.top_k.unwrap_or(usual.top_k),
            top_p: self.top_p.unwrap_or(usual.top_p),
            repetition: self.repetition.unwrap_or(usual.repetition),
            variety: self.variety.unwrap_or(usual.variety),
            bar_repeat: self.bar_repeat.unwrap_or(usual.bar_repeat),
            dynamics: self.dynamics.unwrap_or(usual.dynamics),
            beat_emphasis: self.beat_emphasis.unwrap_or(usual.beat_emphasis),
            guidance: self.guidance.unwrap_or(usual.guidance),
            ..usual
        }
    }
}
