//! One clip of a folder of motion: whose it is, what it shows, what it is for.

use std::path::{Path, PathBuf};

use super::styles::style_number;
use servodance_types::named;

/// Whether a clip trains, chooses or judges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)] // train, validation and test
pub enum Split {
    Train = 0,
    /// Sizes and stopping are chosen by it.
    Validation = 1,
    Test = 2,
}

named!(Split { Train "train", Validation "validation", Test "test" });

/// One line of the index of a folder of clips.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)] // columns of the index, docs/dataset.md
pub struct ClipEntry {
    /// `source/file`, without the ending.
    pub name: String,
    pub source: String,
    /// On what terms; empty where that is not written.
    pub licence: String,
    pub dance: bool,
    pub label: String,
    pub minutes: f64,
    /// The style that is written, if one is.
    pub written_style: Option<usize>,
    /// Whether the clip's file holds the music that it is danced to.
    pub music: bool,
    /// See `motion/soundness.rs`, before the clip came to the common skeleton.
    pub bone_change: Option<f64>,
    pub split: Split,
}

impl ClipEntry {
    /// The clip's file under the folder of the index.
    pub fn path(&self, folder: &Path) -> PathBuf {
        folder.join(format!("{}.npz", self.name))
    }

    /// The file name, without source and ending.
    pub(super) fn stem(&self) -> &str {
        self.name.rsplit('/').next().unwrap_or(&self.name)
    }

    /// Whether the performer stands on a flat floor throughout. CMU subject 1
    /// climbs a playground and subject 3 walks on uneven ground.
    pub fn on_flat_floor(&self) -> bool {
        let subject = self.stem().split('_').next().unwrap_or("");
        let rough = self.source.starts_with("cmu") && matches!(subject, "01" | "03");
        !rough && !self.label.contains("climb")
    }

    /// The clip's style, an index into [`STYLES`](super::styles::STYLES).
    pub fn style(&self) -> usize {
        if let Some(style) = self.written_style {
            return style;
        }
        let stem = self.stem();
        let name = if !self.dance {
            let fights = ["karate", "Fence", "Chop", "martial", "sword", "punch"];
            if fights.iter().any(|word| stem.contains(word) || self.label.contains(word)) {
                "martial"
            } else {
                "everyday"
            }
        } else if self.source == "cmu_salsa" || stem.contains("Salsa") {
            "salsa"
        } else if self.label.contains("Michael Jackson") {
            "pop"
        } else if self.source == "g1_moves" && !stem.contains("Modern") {
            "street"
        } else {
            "modern"
        };
        style_number(name).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::styles::STYLES;

    impl ClipEntry {
        /// A training clip of 0.3 minutes.
        pub fn example(name: &str, source: &str, dance: bool, label: &str) -> Self {
            Self {
                licence: String::new(),
                written_style: None,
                music: false,
                bone_change: None,
                name: format!("{source}/{name}"),
                source: source.into(),
                dance,
                label: label.into(),
                minutes: 0.3,
                split: Split::Train,
            }
        }
    }

    #[test]
    fn climbing_is_left_out() {
        assert!(!ClipEntry::example("01_01", "cmu_amc", false, "playground").on_flat_floor());
        assert!(ClipEntry::example("02_01", "cmu_amc", false, "walk").on_flat_floor());
    }

    #[test]
    fn styles_come_from_labels() {
        let style = |e: ClipEntry| STYLES[e.style()];
        assert_eq!(
            style(ClipEntry::example("dance_J_Dance2_Salsa", "g1_moves", true, "")),
            "salsa"
        );
        assert_eq!(style(ClipEntry::example("dance_B_DadDance", "g1_moves", true, "")), "street");
        assert_eq!(
            style(ClipEntry::example("karate_M_Move1", "g1_moves", false, "M_Move1")),
            "martial"
        );
        assert_eq!(style(ClipEntry::example("05_18", "cmu_iclone", true, "dance")), "modern");
    }
}
