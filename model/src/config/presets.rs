//! The named configurations: `live` is what ships, `paper` has the sizes of the
//! MAGMA paper, `tiny` is for tests. The same table in Python:
//! `model/reference/config.py`.

use servodance_types::MUSIC_DIM;

use super::{Activation, ModelConfig, Positions, SeqConfig, VqConfig};
use crate::conditioning::MusicKind;
use crate::motion::representation::POSE_DIM;

/// Names of the presets.
pub const PRESETS: [&str; 3] = ["live", "paper", "tiny"];

/// Width of a head of the paper's attention: 8 of them are narrower than the
/// model (768), as in the code released with it.
const PAPER_HEAD_DIM: usize = 64;
/// Frames that the paper trains on and scores.
const PAPER_WINDOW: usize = 400;

impl ModelConfig {
    /// The configuration of that name, without styles; none if it is unknown
    /// (see [`PRESETS`]).
    pub fn preset(name: &str) -> Option<Self> {
        match name {
            "live" => Some(live()),
            "paper" => Some(paper()),
            "tiny" => Some(tiny()),
            _ => None,
        }
    }
}

/// A geometric sequence from 1/2 to 1/256, whatever the number of heads.
fn alibi_slopes(heads: usize, scale: f32) -> Vec<f32> {
    let last = heads.saturating_sub(1).max(1) as f32;
    let slope = |h| scale * (-(1.0 + 7.0 * h as f32 / last)).exp2();
    (0..heads).map(slope).collect()
}

fn names(parts: &[&str]) -> Vec<String> {
    parts.iter().map(|part| (*part).to_owned()).collect()
}

fn live() -> ModelConfig {
    ModelConfig {
        preset: "live".into(),
        motion_dim: POSE_DIM,
        music: MusicKind::default(),
        music_dim: MUSIC_DIM,
        parts: names(&["trunk", "left_leg", "right_leg", "left_arm", "right_arm"]),
        codes: 256,
        code_dim: 32,
        activation: Activation::Relu2,
        vq: VqConfig {
            dim: 192,
            heads: 6,
            head_dim: None,
            ff: 768,
            encoder_dim: 128,
            encoder_layers: 3,
            encoder_window: 16,
            encoder_slopes: alibi_slopes(4, 1.0),
            decoder_layers: 4,
            decoder_window: 64,
            decoder_slopes: alibi_slopes(6, 1.0),
        },
        seq: SeqConfig {
            dim: 256,
            heads: 8,
            head_dim: None,
            ff: 1024,
            layers: 4,
            window: 160,
            slopes: alibi_slopes(8, 1.0),
            cross_slopes: alibi_slopes(8, 1.0),
            cross_aligned: true,
            lookahead: 0,
            music_at_input: true,
            style_dim: 64,
            styles: Vec::new(),
            positions: Positions::Alibi,
            eos: false,
        },
    }
}

fn paper() -> ModelConfig {
    // Eq. 1 puts the bias inside the division by sqrt(d_k).
    let slopes = alibi_slopes(8, (PAPER_HEAD_DIM as f32).sqrt().recip());
    let base = live();
    ModelConfig {
        preset: "paper".into(),
        parts: names(&["whole"]),
        codes: 1024,
        code_dim: 768,
        activation: Activation::Gelu,
        vq: VqConfig {
            dim: 768,
            heads: 8,
            head_dim: Some(PAPER_HEAD_DIM),
            ff: 3072,
            encoder_dim: 768,
            encoder_layers: 12,
            encoder_window: PAPER_WINDOW,
            encoder_slopes: slopes.clone(),
            decoder_layers: 12,
            decoder_window: PAPER_WINDOW,
            decoder_slopes: slopes.clone(),
        },
        seq: SeqConfig {
            dim: 768,
            heads: 8,
            head_dim: Some(PAPER_HEAD_DIM),
            ff: 3072,
            layers: 12,
            window: PAPER_WINDOW,
            slopes,
            cross_slopes: vec![0.0; 8],
            cross_aligned: false,
            music_at_input: false,
            style_dim: 512,
            eos: true,
            ..base.seq
        },
        ..base
    }
}

fn tiny() -> ModelConfig {
    let base = live();
    ModelConfig {
        preset: "tiny".into(),
        parts: names(&["lower", "upper"]),
        codes: 16,
        code_dim: 8,
        vq: VqConfig {
            dim: 32,
            heads: 4,
            head_dim: None,
            ff: 64,
            encoder_dim: 32,
            encoder_layers: 1,
            encoder_window: 4,
            encoder_slopes: alibi_slopes(4, 1.0),
            decoder_layers: 2,
            decoder_window: 6,
            decoder_slopes: alibi_slopes(4, 1.0),
        },
        seq: SeqConfig {
            dim: 32,
            heads: 4,
            ff: 64,
            layers: 2,
            window: 8,
            slopes: alibi_slopes(4, 1.0),
            cross_slopes: alibi_slopes(4, 1.0),
            style_dim: 8,
            styles: names(&["plain", "wild"]),
            ..base.seq
        },
        ..base
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_passes_its_own_check() {
        for name in PRESETS {
            let config = ModelConfig::preset(name).unwrap();
            assert_eq!(config.preset, name);
            let text = serde_json::to_string(&config).unwrap();
            assert_eq!(ModelConfig::from_json(&text), Ok(config));
        }
        assert_eq!(ModelConfig::preset("huge"), None);
    }

    #[test]
    fn the_preset_live_is_what_ships() {
        let shipped = crate::Generator::built_in().unwrap().config().clone();
        let mut preset = ModelConfig::preset("live").unwrap();
        preset.seq.styles.clone_from(&shipped.seq.styles);
        assert_eq!(
            (shipped.vq.dim, &shipped.parts, shipped.codes),
            (preset.vq.dim, &preset.parts, preset.codes)
        );
        let without_slopes = |mut config: ModelConfig| {
            let vq = &mut config.vq;
            let seq = &mut config.seq;
            for slopes in [
                &mut vq.encoder_slopes,
                &mut vq.decoder_slopes,
                &mut seq.slopes,
                &mut seq.cross_slopes,
            ] {
                for slope in slopes {
                    *slope = (*slope * 1e5).round();
                }
            }
            config
        };
        assert_eq!(without_slopes(shipped), without_slopes(preset));
    }
}
