//! What kinds of music features there are. Weights say in their configuration
//! which kind they were trained on; another kind is refused, never converted.

use serde::{Deserialize, Serialize};
use servodance_types::{MUSIC_DIM, SPECTRAL_DIM, named};

/// Numbers of one frame of Encodec latents.
pub const LATENT_DIM: usize = 128;

/// A kind of music features.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MusicKind {
    /// The 35 features of AIST++ and the tracked beat: those of the built-in weights.
    #[default]
    Servodance39,
    /// The 35 features alone, as the paper's.
    Librosa35,
    /// Quantised Encodec latents, as the paper's best.
    Encodec128,
}

named!(MusicKind {
    Servodance39 "servodance39", Librosa35 "librosa35", Encodec128 "encodec128"
});

impl MusicKind {
    /// Numbers of one frame in the form that the networks take.
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
