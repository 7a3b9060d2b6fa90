//! The named configurations: `live` is what ships, `paper` has the sizes of the
//! MAGMA paper and its released code, `tiny` is for tests. They are JSON files,
//! read by `model/reference/config.py` too.

use super::ModelConfig;

/// Names of the presets.
pub const PRESETS: [&str; 3] = ["live", "paper", "tiny"];

/// The texts of the presets, in the order of their names.
const TEXTS: [&str; 3] = [
    include_str!("presets/live.json"),
    include_str!("presets/paper.json"),
    include_str!("presets/tiny.json"),
];

impl ModelConfig {
    /// The configuration of that name out of [`PRESETS`], without styles.
    pub fn preset(name: &str) -> Option<Self> {
        let at = PRESETS.iter().position(|preset| *preset == name)?;
        Self::from_json(TEXTS[at]).ok()
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
    fn slopes_are_geometric_from_a_half_on() {
        let slopes = |heads: usize, scale: f32| -> Vec<f32> {
            let last = heads.saturating_sub(1).max(1) as f32;
            let slope = |h| scale * (-(1.0 + 7.0 * h as f32 / last)).exp2();
            (0..heads).map(slope).collect()
        };
        // Eq. 1 puts the bias inside the division by sqrt(d_k).
        for (name, scale) in [("live", 1.0), ("paper", 64f32.sqrt().recip()), ("tiny", 1.0)] {
            let ModelConfig { vq, seq, .. } = ModelConfig::preset(name).unwrap();
            for found in [vq.encoder_slopes, vq.decoder_slopes, seq.slopes] {
                assert_eq!(found, slopes(found.len(), scale), "{name}");
            }
        }
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
