//! What one variant reached.

use crate::evaluate::{Evaluation, MeanEstimate};
use serde::{Deserialize, Serialize};

/// A mean and half the width of its 95 % interval.
pub(super) type MeanAndInterval = (f64, f64);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AblationRow {
    pub(super) name: String,
    pub(super) what: String,
    /// Nats a frame on held-out codes; says nothing between variants with other codes.
    pub(super) nll: f64,
    /// How much worse that gets with another clip's music: does it listen?
    pub(super) nll_for_music: f64,
    pub(super) scores: AblationScores,
}

/// A figure's name in files, and how to get it.
type ScoreColumn = (&'static str, fn(&AblationScores) -> MeanAndInterval);

/// Declares the figures of a variant, each with its place in an evaluation.
macro_rules! scores {
    ($($name:ident: $($from:ident).+,)*) => {
        /// Figures of the dances of a variant, named as in [`Evaluation`].
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        pub(super) struct AblationScores {
            $(pub $name: MeanAndInterval,)*
        }

        pub(super) const COLUMNS: &[ScoreColumn] = &[$((stringify!($name), |s| s.$name),)*];

        impl From<&Evaluation> for AblationScores {
            fn from(found: &Evaluation) -> Self {
                let figure = |estimate: MeanEstimate| (estimate.mean, estimate.ci95);
                Self {
                    $($name: figure(found.$($from).+),)*
                }
            }
        }
    };
}

scores! {
    mpjpe_mm: mpjpe_mm,
    codes_used: codes_used,
    fact: beat.own.fact,
    f1: beat.own.f1,
    f1_silence: beat.silence,
    fid_k: fid_k,
    fid_g: fid_g,
    dist_k: dist_k,
    dist_g: dist_g,
    jerk: physical.jerk,
}
