//! What kinds of music features there are, and which numbers each takes out of
//! what was heard.
//!
//! Weights say in their configuration which kind they were trained on; another
//! kind is refused, never converted.

use serde::{Deserialize, Serialize};
use servodance_types::{MUSIC_DIM, MusicFrame, SPECTRAL_DIM};

use super::encodec::{LATENT_DIM, Latent};

/// A kind of music features.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MusicKind {
    /// The 35 features of AIST++ and the tracked beat: what the built-in
    /// weights hear.
    #[default]
    Servodance39,
    /// The 35 features alone, as the paper's.
    Librosa35,
    /// Quantised Encodec latents, as the paper's best.
    Encodec128,
}

impl MusicKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Servodance39, Self::Librosa35, Self::Encodec128];

    /// What configurations and options call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Servodance39 => "servodance39",
            Self::Librosa35 => "librosa35",
            Self::Encodec128 => "encodec128",
        }
    }

    /// The kind of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Numbers a frame.
    pub const fn dim(self) -> usize {
        match self {
            Self::Servodance39 => MUSIC_DIM,
            Self::Librosa35 => SPECTRAL_DIM,
            Self::Encodec128 => LATENT_DIM,
        }
    }

    /// How many of them are measured (and clamped when they are far out); the
    /// others are the beat, of a known range.
    pub const fn measured(self) -> usize {
        match self {
            Self::Servodance39 | Self::Librosa35 => SPECTRAL_DIM,
            Self::Encodec128 => LATENT_DIM,
        }
    }
}

/// One frame of music, and its Encodec latent where that is listened for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeardFrame {
    /// Features and beat.
    pub frame: MusicFrame,
    /// What Encodec hears of it.
    pub latent: Option<Latent>,
}

impl From<MusicFrame> for HeardFrame {
    fn from(frame: MusicFrame) -> Self {
        Self {
            frame,
            latent: None,
        }
    }
}

impl HeardFrame {
    /// Writes the numbers that a kind of features consists of; false if they
    /// were not listened for.
    pub fn features(&self, kind: MusicKind, out: &mut Vec<f32>) -> bool {
        out.clear();
        match (kind, &self.latent) {
            (MusicKind::Encodec128, None) => return false,
            (MusicKind::Encodec128, Some(latent)) => out.extend_from_slice(latent),
            (MusicKind::Servodance39 | MusicKind::Librosa35, _) => {
                out.extend_from_slice(&self.frame.vector()[..kind.dim()]);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_takes_as_many_numbers_as_it_says() {
        let mut heard = HeardFrame::from(MusicFrame::default());
        let mut out = vec![7.0];
        assert!(!heard.features(MusicKind::Encodec128, &mut out));
        heard.latent = Some([0.5; LATENT_DIM]);
        for kind in MusicKind::ALL {
            assert!(heard.features(kind, &mut out));
            assert_eq!(out.len(), kind.dim());
            assert!(kind.measured() <= kind.dim());
            assert_eq!(MusicKind::from_name(kind.name()), Some(kind));
            let json = serde_json::to_string(&kind).unwrap();
            assert_eq!(json, format!("{:?}", kind.name()));
        }
    }
}
