//! What is measured of a dance itself, generated or captured.

use crate::metrics::quality::{foot_skate_ratio, mean_jerk_m_s3};
use crate::metrics::richness::Richness;
use serde::Serialize;
use servodance_model::motion::Clip;

/// How rich and how smooth a dance is, or a set of dances on average.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(crate) struct DanceFigures {
    #[serde(flatten)]
    pub(crate) richness: Richness,
    /// Mean jerk of all joints, m/s^3: richness that comes with jerk may be jitter.
    pub(crate) jerk_m_s3: f64,
    /// Share of contact frames in which a foot skates.
    pub(crate) foot_skate: f64,
}

impl DanceFigures {
    /// Of one dance; `None` where it has no richness.
    pub(super) fn of(clip: &Clip) -> Option<Self> {
        Some(Self {
            richness: Richness::of(clip)?,
            jerk_m_s3: mean_jerk_m_s3(clip),
            foot_skate: foot_skate_ratio(clip).unwrap_or(0.0),
        })
    }

    pub(super) fn mean(all: &[Self]) -> Self {
        let over = |of: fn(&Self) -> f64| all.iter().map(of).sum::<f64>() / all.len().max(1) as f64;
        let richness: Vec<Richness> = all.iter().map(|figures| figures.richness).collect();
        Self {
            richness: Richness::mean(&richness),
            jerk_m_s3: over(|f| f.jerk_m_s3),
            foot_skate: over(|f| f.foot_skate),
        }
    }
}
