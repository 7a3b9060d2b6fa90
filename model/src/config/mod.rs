//! The model's configuration: one JSON object in the weights file's metadata.
//!
//! Every size is a field, so `live` (what ships) and `paper` are the same code.
//! Lengths are frames at 20 a second. The same object in Python:
//! `model/reference/config.py`.

use serde::{Deserialize, Serialize};

use crate::motion::representation::POSE_DIM;

mod body_parts;
mod code_place;
mod encoder_kind;
mod music_kind;
mod presets;

pub use body_parts::{part_channels, position_channels};
pub use code_place::CodePlace;
pub use encoder_kind::EncoderKind;
pub use music_kind::{LATENT_DIM, MusicKind};
pub use presets::PRESETS;

/// What stands between the two layers of a feed-forward block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Activation {
    /// GELU, tanh form (the paper's).
    Gelu,
    /// The squared ReLU, of the built-in weights.
    Relu2,
}

/// How MotionSeq knows where a frame stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Positions {
    /// Relative: a bias that falls with the distance, per head (ALiBi).
    #[default]
    Alibi,
    /// Absolute sinusoids added to codes and music: the paper's ablation, which
    /// freezes once a dance is longer than what it was trained on.
    Sinusoidal,
}

/// Sizes of both networks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelConfig {
    /// Name of the preset: `live`, `paper` or `tiny`.
    pub preset: String,
    /// Numbers a motion frame: 137.
    pub motion_dim: usize,
    /// The music features that the model hears.
    #[serde(default, skip_serializing_if = "is_default")]
    pub music: MusicKind,
    /// Numbers a music frame, those of its kind.
    pub music_dim: usize,
    /// Body parts with codebooks of their own, in sampling order.
    pub parts: Vec<String>,
    /// Codebooks of each part, 1 if left out: each one codes what those before it left
    /// (residual vector quantisation), and the vectors of their codes are added.
    #[serde(default, skip_serializing_if = "is_default")]
    pub levels: Vec<usize>,
    /// Codes in a codebook.
    pub codes: usize,
    /// Width of a code.
    pub code_dim: usize,
    /// Activation of all feed-forward blocks.
    pub activation: Activation,
    /// Sizes of the VQ-VAE.
    pub vq: VqConfig,
    /// Sizes of MotionSeq.
    pub seq: SeqConfig,
}

/// Sizes of the VQ-VAE: the encoders, the decoder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VqConfig {
    /// What is quantised.
    #[serde(default, skip_serializing_if = "is_default")]
    pub encoder: EncoderKind,
    /// Encoders and decoder add a linear map of their input to their output.
    #[serde(default, skip_serializing_if = "is_default")]
    pub skip: bool,
    /// Width of the vectors between layers.
    pub dim: usize,
    /// Attention heads of each layer.
    pub heads: usize,
    /// Width of a head, here and in the encoders; without it heads share `dim`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub head_dim: Option<usize>,
    /// Width inside a feed-forward block.
    pub ff: usize,
    /// Width of a part's encoder.
    pub encoder_dim: usize,
    /// Layers of a part's encoder.
    pub encoder_layers: usize,
    /// Frames an encoder layer sees to each side.
    pub encoder_window: usize,
    /// ALiBi slope of each encoder head.
    pub encoder_slopes: Vec<f32>,
    /// Layers of the decoder.
    pub decoder_layers: usize,
    /// Frames a decoder layer sees, its own among them.
    pub decoder_window: usize,
    /// ALiBi slope of each decoder head.
    pub decoder_slopes: Vec<f32>,
}

/// Sizes of MotionSeq, the causal transformer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeqConfig {
    /// Width of the vectors between layers.
    pub dim: usize,
    /// Attention heads of each layer.
    pub heads: usize,
    /// Width of a head; without it heads share the model width.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub head_dim: Option<usize>,
    /// Width inside a feed-forward block.
    pub ff: usize,
    /// Layers of the transformer.
    pub layers: usize,
    /// Frames a layer sees, its own among them.
    pub window: usize,
    /// ALiBi slope of each self-attention head.
    pub slopes: Vec<f32>,
    /// ALiBi slope of each cross-attention head.
    pub cross_slopes: Vec<f32>,
    /// Music frame j is visible to frame i when j <= i + lookahead; else, as
    /// in the paper's code, all music is one unordered bag.
    pub cross_aligned: bool,
    /// Music frames seen ahead of the motion; 0 for live music.
    pub lookahead: usize,
    /// The frame's own music is also added to the token input.
    pub music_at_input: bool,
    /// Width of a style vector.
    pub style_dim: usize,
    /// Names of the styles; the table has one row more, for no style.
    pub styles: Vec<String>,
    /// How a frame's place is known.
    #[serde(default, skip_serializing_if = "is_default")]
    pub positions: Positions,
    /// The first part's head has one class more than codes: the sequence ends.
    #[serde(default, skip_serializing_if = "is_default")]
    pub eos: bool,
}

/// Written only where it says something new: older readers know no more.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl VqConfig {
    /// Width of a decoder head.
    pub fn decoder_head_dim(&self) -> usize {
        self.head_dim.unwrap_or(self.dim / self.heads)
    }

    /// Width of an encoder head.
    pub fn encoder_head_dim(&self) -> usize {
        let heads = self.encoder_slopes.len();
        self.head_dim.unwrap_or(self.encoder_dim / heads)
    }
}

impl SeqConfig {
    /// Width of a head.
    pub fn width_of_head(&self) -> usize {
        self.head_dim.unwrap_or(self.dim / self.heads)
    }

    /// Slopes of the self-attention heads as they are used: zeros with absolute
    /// positions instead of ALiBi.
    pub fn used_slopes(&self) -> Vec<f32> {
        match self.positions {
            Positions::Alibi => self.slopes.clone(),
            Positions::Sinusoidal => vec![0.0; self.heads],
        }
    }

    /// Likewise of the cross-attention heads: none in the paper's bag of music.
    pub fn used_cross_slopes(&self) -> Vec<f32> {
        match self.positions {
            Positions::Alibi if self.cross_aligned => self.cross_slopes.clone(),
            _ => vec![0.0; self.heads],
        }
    }
}

impl ModelConfig {
    /// Classes of a code's head: the codes, and in the first one the end of
    /// the sequence where the configuration has one.
    pub fn classes(&self, code: usize) -> usize {
        self.codes + usize::from(self.seq.eos && code == 0)
    }

    /// Parses and checks; the error names the field, its value and the range.
    pub fn from_json(text: &str) -> Result<Self, String> {
        let config: Self = serde_json::from_str(text).map_err(|e| e.to_string())?;
        config.check()?;
        Ok(config)
    }

    fn check(&self) -> Result<(), String> {
        expect("motion_dim", self.motion_dim, POSE_DIM)?;
        if self.music_dim != self.music.dim() {
            return Err(format!(
                "music_dim is {}, expected {} for the music features {}",
                self.music_dim,
                self.music.dim(),
                self.music.name()
            ));
        }
        self.check_levels()?;
        for part in &self.parts {
            part_channels(part)?;
            let positions = position_channels(part)?.len();
            if self.vq.encoder == EncoderKind::Positions && positions > self.code_dim {
                return Err(format!(
                    "code_dim is {}, expected at least {positions}: `{part}` has so many positions",
                    self.code_dim
                ));
            }
        }
        let (vq, seq) = (&self.vq, &self.seq);
        for (name, value, limit) in [
            ("parts", self.parts.len(), 8),
            ("codes", self.codes, 65_536),
            ("code_dim", self.code_dim, 8192),
            ("vq.dim", vq.dim, 8192),
            ("vq.ff", vq.ff, 65_536),
            ("vq.encoder_dim", vq.encoder_dim, 8192),
            ("vq.encoder_layers", vq.encoder_layers, 64),
            ("vq.encoder_window", vq.encoder_window, 4096),
            ("vq.decoder_layers", vq.decoder_layers, 64),
            ("vq.decoder_window", vq.decoder_window, 4096),
            ("seq.dim", seq.dim, 8192),
            ("seq.ff", seq.ff, 65_536),
            ("seq.layers", seq.layers, 64),
            ("seq.window", seq.window, 4096),
            ("seq.style_dim", seq.style_dim, 8192),
            ("vq.head_dim", vq.head_dim.unwrap_or(1), 1024),
            ("seq.head_dim", seq.head_dim.unwrap_or(1), 1024),
        ] {
            if value == 0 || value > limit {
                return Err(format!("{name} is {value}, expected 1 to {limit}"));
            }
        }
        let shared = |name, count, dim, own: Option<usize>| heads(name, count, dim, own.is_some());
        shared("vq.heads", vq.heads, vq.dim, vq.head_dim)?;
        let encoder_heads = vq.encoder_slopes.len();
        shared("vq.encoder_slopes", encoder_heads, vq.encoder_dim, vq.head_dim)?;
        shared("seq.heads", seq.heads, seq.dim, seq.head_dim)?;
        slopes("vq.encoder_slopes", &vq.encoder_slopes, encoder_heads)?;
        slopes("vq.decoder_slopes", &vq.decoder_slopes, vq.heads)?;
        slopes("seq.slopes", &seq.slopes, seq.heads)?;
        slopes("seq.cross_slopes", &seq.cross_slopes, seq.heads)
    }
}

fn expect(name: &str, found: usize, expected: usize) -> Result<(), String> {
    if found == expected {
        return Ok(());
    }
    Err(format!("{name} is {found}, expected {expected}"))
}

fn heads(name: &str, heads: usize, dim: usize, own_width: bool) -> Result<(), String> {
    if heads == 0 || heads > 256 || !(own_width || dim.is_multiple_of(heads)) {
        return Err(format!("{name} is {heads}, which does not divide the width {dim}"));
    }
    Ok(())
}

fn slopes(name: &str, slopes: &[f32], heads: usize) -> Result<(), String> {
    if slopes.len() != heads || slopes.iter().any(|s| !(0.0..=16.0).contains(s)) {
        return Err(format!("{name} is {slopes:?}, expected {heads} numbers from 0 to 16"));
    }
    Ok(())
}
