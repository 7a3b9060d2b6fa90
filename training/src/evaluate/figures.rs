//! The figures of a set of dances.

use crate::metrics::distribution::{Distribution, DistributionError, compare};
use crate::metrics::features::{Acceleration, geometric, kinetic};
use crate::metrics::quality::{foot_skate_ratio, frozen_ratio, mean_jerk_m_s3, pfc};
use crate::metrics::repetition::nearest_figure_m;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use servodance_model::motion::{Alignment, Clip, Pose, alignment, mean_joint_speed};
use servodance_types::FRAME_RATE_HZ;

/// Distributions compare windows of ten seconds.
pub const WINDOW_FRAMES: usize = 200;

#[derive(Clone, Debug, Default)]
pub struct DanceScores {
    pub fact: f64,
    pub bailando: f64,
    pub f1: f64,
    pub pfc: f64,
    pub foot_skate: f64,
    pub jerk: f64,
    pub freeze_ratio: f64,
    /// From a figure of four beats to the most similar one, metres.
    pub figure_gap_m: f64,
    /// Against the real set; of real motion, one half against the other.
    pub distances: Option<FeatureDistances>,
}

#[derive(Clone, Copy, Debug)]
pub struct FeatureDistances {
    pub kinetic: Distribution,
    pub kinetic_published: Distribution,
    pub geometric: Distribution,
}

impl DanceScores {
    /// Of dances with the beats of their music, seconds.
    pub fn of<'a>(dances: impl Iterator<Item = (&'a [Pose], &'a [f64])>) -> Self {
        let mut rows: Vec<[f64; 8]> = Vec::new();
        for (poses, beats_s) in dances {
            let beat = beat_alignment(poses, beats_s);
            let clip = Clip::of_frames(poses.to_vec());
            rows.push([
                beat.fact,
                beat.bailando,
                beat.f1,
                pfc(&clip).unwrap_or(0.0),
                foot_skate_ratio(&clip).unwrap_or(0.0),
                mean_jerk_m_s3(&clip),
                frozen_ratio(poses, FRAME_RATE_HZ),
                nearest_figure_m(&clip, beats_s).unwrap_or(f64::NAN),
            ]);
        }
        // Too few beats to compare figures: not a number, and not counted.
        let known = |k: usize| rows.iter().map(move |row| row[k]).filter(|v| v.is_finite());
        let column = |k: usize| mean(&known(k).collect::<Vec<_>>());
        Self {
            fact: column(0),
            bailando: column(1),
            f1: column(2),
            pfc: column(3),
            foot_skate: column(4),
            jerk: column(5),
            freeze_ratio: column(6),
            figure_gap_m: column(7),
            distances: None,
        }
    }
}

/// Kinematic beats of a dance against music beats, seconds.
pub fn beat_alignment(poses: &[Pose], beats_s: &[f64]) -> Alignment {
    let speed = mean_joint_speed(poses, FRAME_RATE_HZ);
    alignment(&speed, FRAME_RATE_HZ, beats_s)
}

pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The features of every window of a set of dances.
#[derive(Clone, Debug, Default)]
pub struct WindowFeatures {
    windows: Vec<[Vec<f64>; 3]>,
}

impl WindowFeatures {
    pub fn of<'a>(dances: impl Iterator<Item = &'a [Pose]>) -> Self {
        let windows = dances.flat_map(|poses| poses.chunks_exact(WINDOW_FRAMES));
        let features = windows.filter_map(|poses| {
            let window = Clip::of_frames(poses.to_vec());
            Some([
                kinetic(&window, Acceleration::Correct)?.to_vec(),
                kinetic(&window, Acceleration::Published)?.to_vec(),
                geometric(&window)?.to_vec(),
            ])
        });
        Self { windows: features.collect() }
    }

    pub fn len(&self) -> usize {
        self.windows.len()
    }

    /// This set against a real one, both normalised by `yardstick`.
    pub fn against(
        &self,
        real: &Self,
        yardstick: &Self,
    ) -> Result<FeatureDistances, DistributionError> {
        let kind = |k: usize| -> Result<Distribution, DistributionError> {
            let column = |set: &Self| set.windows.iter().map(|w| w[k].clone()).collect();
            compare(&column(yardstick), &column(real), &column(self))
        };
        Ok(FeatureDistances { kinetic: kind(0)?, kinetic_published: kind(1)?, geometric: kind(2)? })
    }

    pub fn halves(&self, rng: &mut ChaCha8Rng) -> (Self, Self) {
        let mut windows = self.windows.clone();
        windows.shuffle(rng);
        let other = windows.split_off(windows.len() / 2);
        (Self { windows }, Self { windows: other })
    }
}
