//! The model's configuration: one JSON object in the weights file's metadata.
//!
//! Every size is a field, so `live` (what ships) and `paper` are the same code.
//! Lengths are frames at 20 a second. The same object in Python:
//! `model/reference/config.py`.

use serde::{Deserialize, Serialize};

use crate::conditioning::MusicKind;
use crate::motion::representation::POSE_DIM;

/// What stands between the two layers of a feed-forward block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Activation {
    /// GELU, tanh form (the paper's).
    Gelu,
    /// The squared ReLU.
    Relu2,
}

/// Sizes of both stages.
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
    /// Body parts with a codebook each, in sampling order.
    pub parts: Vec<String>,
    /// Codes in a codebook.
    pub codes: usize,
    /// Width of a code.
    pub code_dim: usize,
    /// Feed-forward activation.
    pub activation: Activation,
    /// Stage 1.
    pub vq: VqConfig,
    /// Stage 2.
    pub seq: SeqConfig,
}

/// Stage 1, the VQ-VAE.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VqConfig {
    /// Model width.
    pub dim: usize,
    /// Attention heads.
    pub heads: usize,
    /// Feed-forward width.
    pub ff: usize,
    /// Width of a part's encoder.
    pub encoder_dim: usize,
    /// Encoder layers.
    pub encoder_layers: usize,
    /// Frames an encoder layer sees to each side.
    pub encoder_window: usize,
    /// ALiBi slope of each encoder head.
    pub encoder_slopes: Vec<f32>,
    /// Decoder layers.
    pub decoder_layers: usize,
    /// Frames a decoder layer sees, its own among them.
    pub decoder_window: usize,
    /// ALiBi slope of each decoder head.
    pub decoder_slopes: Vec<f32>,
}

/// Stage 2, MotionSeq.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeqConfig {
    /// Model width.
    pub dim: usize,
    /// Attention heads.
    pub heads: usize,
    /// Feed-forward width.
    pub ff: usize,
    /// Layers.
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
}

/// Written only where it says something new: older readers know no more.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl ModelConfig {
    /// Parses and checks; the error names the field, what it is and what it
    /// should be.
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
        ] {
            if value == 0 || value > limit {
                return Err(format!("{name} is {value}, expected 1 to {limit}"));
            }
        }
        heads(
            "vq.heads",
            vq.heads,
            vq.dim,
            &[("vq.decoder_slopes", &vq.decoder_slopes)],
        )?;
        heads(
            "vq.encoder_slopes",
            vq.encoder_slopes.len(),
            vq.encoder_dim,
            &[("vq.encoder_slopes", &vq.encoder_slopes)],
        )?;
        heads(
            "seq.heads",
            seq.heads,
            seq.dim,
            &[
                ("seq.slopes", &seq.slopes),
                ("seq.cross_slopes", &seq.cross_slopes),
            ],
        )
    }
}

fn expect(name: &str, found: usize, expected: usize) -> Result<(), String> {
    if found == expected {
        return Ok(());
    }
    Err(format!("{name} is {found}, expected {expected}"))
}

fn heads(name: &str, heads: usize, dim: usize, slopes: &[(&str, &[f32])]) -> Result<(), String> {
    if heads == 0 || !dim.is_multiple_of(heads) {
        return Err(format!(
            "{name} is {heads}, which does not divide the width {dim}"
        ));
    }
    for (name, slopes) in slopes {
        if slopes.len() != heads || slopes.iter().any(|s| !(0.0..=16.0).contains(s)) {
            return Err(format!(
                "{name} is {slopes:?}, expected {heads} numbers from 0 to 16"
            ));
        }
    }
    Ok(())
}
