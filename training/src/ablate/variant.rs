//! What is taken away or exchanged, one thing at a time: changes to a settings
//! file of `servodance train`.

use anyhow::{Context, anyhow};
use toml_edit::{DocumentMut, Item, Table, value};

#[derive(Clone, Copy)]
pub struct AblationVariant {
    pub name: &'static str,
    pub what: &'static str,
    /// The settings that differ, as TOML.
    changes: &'static str,
    /// Whether motion becomes other codes: then the VQ-VAE is trained anew.
    pub own_codes: bool,
    /// Whether it learns from the training file with Encodec latents.
    pub latents: bool,
    /// The style that it is scored in; that of each clip if none.
    pub style: Option<&'static str>,
}

/// A variant with the codes of the whole model.
const fn other(name: &'static str, what: &'static str, changes: &'static str) -> AblationVariant {
    AblationVariant { name, what, changes, own_codes: false, latents: false, style: None }
}

const fn with_own_codes(variant: AblationVariant) -> AblationVariant {
    AblationVariant { own_codes: true, ..variant }
}

/// All of them; the first is the whole model, whose codes the others use.
pub const VARIANTS: [AblationVariant; 8] = [
    with_own_codes(other("whole", "as in the settings", "")),
    other("sinusoidal", "absolute positions in place of ALiBi", "model.positions = \"sinusoidal\""),
    AblationVariant {
        style: Some("none"),
        ..other("no-style", "the style is never told", "tokens.style_drop = 1.0")
    },
    other(
        "not-aligned",
        "music without its order and time (the paper's cross-attention)",
        "model.cross_aligned = false",
    ),
    other("librosa35", "35 features without the tracked beat", "model.music = \"librosa35\""),
    AblationVariant {
        latents: true,
        ..other(
            "encodec",
            "128 Encodec latents in place of features and beat",
            "model.music = \"encodec128\"",
        )
    },
    with_own_codes(other(
        "plain-codebook",
        "codes begin at random and never begin anew",
        "codebook = { k_means_rounds = 0, dead_below = 0.0 }",
    )),
    with_own_codes(other(
        "one-codebook",
        "one code of 1024 for the whole body",
        "model = { parts = [\"whole\"], codes = 1024 }",
    )),
];

impl AblationVariant {
    /// The settings of this variant, from those of the whole model. Fails on settings that are
    /// no TOML, or have a number where a table belongs.
    pub fn settings(&self, whole: &str) -> anyhow::Result<String> {
        let mut document: DocumentMut = whole.parse()?;
        for key in ["data", "out", "stage_one"] {
            document.remove(key); // given on the way
        }
        let changes: DocumentMut = self.changes.parse()?;
        for (name, changed) in changes.iter() {
            let table = document.entry(name).or_insert(Item::Table(Table::new()));
            let table = table.as_table_like_mut();
            let table = table.with_context(|| anyhow!("`{name}` is not a table"))?;
            for (key, item) in changed.as_table_like().into_iter().flat_map(|t| t.iter()) {
                let changed = item.as_value().cloned().context("a change is a value")?;
                table.insert(key, value(changed.decorated(" ", "")));
            }
        }
        Ok(document.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::{SettingsFile, TrainedNetwork};
    use servodance_model::conditioning::MusicKind;

    #[test]
    fn every_variant_is_a_settings_file_that_says_something_else() {
        let whole = "preset = \"tiny\"\ndata = \"d\"\n[tokens]\nnoise = 0.1\n";
        let resolved = |variant: &AblationVariant| {
            let file: SettingsFile = toml::from_str(&variant.settings(whole).unwrap()).unwrap();
            assert_eq!((file.data.clone(), file.tokens.noise), (None, 0.1));
            [TrainedNetwork::VqVae, TrainedNetwork::MotionSeq]
                .map(|network| file.resolve(network).unwrap())
        };
        let first = resolved(&VARIANTS[0]);
        for variant in &VARIANTS[1..] {
            let other = resolved(variant);
            assert_ne!(other, first, "{}", variant.name);
            let hears = other[1].model.music == MusicKind::Encodec128;
            assert_eq!(hears, variant.latents, "{}", variant.name);
            let same_codes = other[0].model.parts == first[0].model.parts
                && other[0].codebook == first[0].codebook;
            assert_eq!(same_codes, !variant.own_codes, "{}", variant.name);
        }
    }

    #[test]
    fn a_number_where_a_table_belongs_is_named() {
        let error = VARIANTS[2].settings("tokens = 3").unwrap_err();
        assert!(error.to_string().contains("tokens"), "{error}");
    }
}
