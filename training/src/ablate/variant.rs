//! What is taken away or exchanged, one thing at a time: changes to a settings
//! file of `servodance train`.

use anyhow::{Context, anyhow};
use toml_edit::{DocumentMut, Item, Table, Value, value};

pub struct AblationVariant {
    pub name: &'static str,
    pub what: &'static str,
    /// The settings that differ: table, key, value.
    changes: fn() -> Vec<(&'static str, &'static str, Value)>,
    /// Whether motion becomes other codes: then the VQ-VAE is trained anew.
    pub own_codes: bool,
    /// Whether it learns from the training file with Encodec latents.
    pub latents: bool,
    /// The style that it is scored in; that of each clip if none.
    pub style: Option<&'static str>,
}

const WHOLE: AblationVariant = AblationVariant {
    name: "whole",
    what: "as in the settings",
    changes: Vec::new,
    own_codes: true,
    latents: false,
    style: None,
};

/// All of them; the first is the whole model, whose codes the others use.
pub const VARIANTS: [AblationVariant; 8] = [
    WHOLE,
    AblationVariant {
        name: "sinusoidal",
        what: "absolute positions in place of ALiBi",
        changes: || vec![("model", "positions", "sinusoidal".into())],
        own_codes: false,
        ..WHOLE
    },
    AblationVariant {
        name: "no-style",
        what: "the style is never told",
        changes: || vec![("tokens", "style_drop", 1.0.into())],
        own_codes: false,
        style: Some("none"),
        ..WHOLE
    },
    AblationVariant {
        name: "not-aligned",
        what: "music without its order and time (the paper's cross-attention)",
        changes: || vec![("model", "cross_aligned", false.into())],
        own_codes: false,
        ..WHOLE
    },
    AblationVariant {
        name: "librosa35",
        what: "35 features without the tracked beat",
        changes: || vec![("model", "music", "librosa35".into())],
        own_codes: false,
        ..WHOLE
    },
    AblationVariant {
        name: "encodec",
        what: "128 Encodec latents in place of features and beat",
        changes: || vec![("model", "music", "encodec128".into())],
        own_codes: false,
        latents: true,
        ..WHOLE
    },
    AblationVariant {
        name: "plain-codebook",
        what: "codes begin at random and never begin anew",
        changes: || {
            vec![("codebook", "k_means_rounds", 0.into()), ("codebook", "dead_below", 0.0.into())]
        },
        ..WHOLE
    },
    AblationVariant {
        name: "one-codebook",
        what: "one code of 1024 for the whole body",
        changes: || {
            let parts: toml_edit::Array = ["whole"].into_iter().collect();
            vec![("model", "parts", parts.into()), ("model", "codes", 1024.into())]
        },
        ..WHOLE
    },
];

impl AblationVariant {
    /// The settings of this variant, from those of the whole model. Fails on settings that are
    /// no TOML, or have a number where a table belongs.
    pub fn settings(&self, whole: &str) -> anyhow::Result<String> {
        let mut document: DocumentMut = whole.parse()?;
        for key in ["data", "out", "stage_one"] {
            document.remove(key); // given on the way
        }
        for (table, key, changed) in (self.changes)() {
            let table = document
                .entry(table)
                .or_insert(Item::Table(Table::new()))
                .as_table_like_mut()
                .with_context(|| anyhow!("`{table}` is not a table"))?;
            table.insert(key, value(changed));
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
