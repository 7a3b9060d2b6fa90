//! The figures of a set of dances.

use crate::metrics::distribution::{Distribution, DistributionError, compare_by};
use crate::metrics::features::{Acceleration, geometric, kinetic};
use crate::metrics::nearest_figure_m;
use crate::metrics::quality::{foot_skate_ratio, freezing, jerk, pfc};
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use servodance_model::motion::{Clip, Pose};
use servodance_model::motion::{alignment, mean_joint_speed};
use servodance_types::FRAME_RATE_HZ;

/// Distributions compare windows of ten seconds.
pub const WINDOW_FRAMES: usize = 200;

/// Means over one set of dances.
#[derive(Clone, Debug, Default)]
pub struct Scores {
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
    pub distances: Option<Distances>,
}

/// Fréchet distances and diversity.
#[derive(Clone, Copy, Debug)]
pub struct Distances {
    pub kinetic: Distribution,
    pub kinetic_published: Distribution,
    pub geometric: Distribution,
}

impl Scores {
    /// Of dances with the beats of their music, seconds.
    pub fn of<'a>(dances: impl Iterator<Item = (&'a [Pose], &'a [f64])>) -> Self {
        let mut rows: Vec<[f64; 8]> = Vec::new();
        for (poses, beats_s) in dances {
            let beat = alignment(
                &mean_joint_speed(poses, FRAME_RATE_HZ),
                FRAME_RATE_HZ,
                beats_s,
            );
            let clip = clip(poses);
            rows.push([
                beat.fact,
                beat.bailando,
                beat.f1,
                pfc(&clip).unwrap_or(0.0),
                foot_skate_ratio(&clip).unwrap_or(0.0),
                jerk(&clip).mean_m_s3,
                freezing(poses, FRAME_RATE_HZ).frozen_ratio,
                nearest_figure_m(&clip, beats_s).unwrap_or(f64::NAN),
            ]);
        }
        // Too few beats to compare figures: not a number, and not counted.
        let known = |k: usize| rows.iter().map(move |row| row[k]).filter(|v| v.is_finite());
        let column = |k: usize| mean(&known(k).collect::<Vec<_>>());
        let [
            fact,
            bailando,
            f1,
            pfc,
            foot_skate,
            jerk,
            freeze_ratio,
            figure_gap_m,
        ] = std::array::from_fn(column);
        Self {
            fact,
            bailando,
            f1,
            pfc,
            foot_skate,
            jerk,
            freeze_ratio,
            figure_gap_m,
            distances: None,
        }
    }
}

/// F1 of kinematic against music beats.
pub fn f1(poses: &[Pose], beats_s: &[f64]) -> f64 {
    alignment(
        &mean_joint_speed(poses, FRAME_RATE_HZ),
        FRAME_RATE_HZ,
        beats_s,
    )
    .f1
}

pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn clip(poses: &[Pose]) -> Clip {
    Clip {
        name: String::new(),
        fps: FRAME_RATE_HZ,
        poses: poses.to_vec(),
    }
}

/// The features of every window of a set of dances.
#[derive(Clone, Debug, Default)]
pub struct Features {
    /// Kinetic, kinetic as published, geometric.
    windows: Vec<[Vec<f64>; 3]>,
}

impl Features {
    pub fn of<'a>(dances: impl Iterator<Item = &'a [Pose]>) -> Self {
        let windows = dances.flat_map(|poses| poses.chunks_exact(WINDOW_FRAMES));
        let features = windows.filter_map(|poses| {
            let window = clip(poses);
            Some([
                kinetic(&window, Acceleration::Correct)?.to_vec(),
                kinetic(&window, Acceleration::Published)?.to_vec(),
                geometric(&window)?.to_vec(),
            ])
        });
        Self {
            windows: features.collect(),
        }
    }

    pub fn len(&self) -> usize {
        self.windows.len()
    }

    /// This set against a real one, both normalised by `yardstick`.
    pub fn against(&self, real: &Self, yardstick: &Self) -> Result<Distances, DistributionError> {
        let kind = |k: usize| -> Result<Distribution, DistributionError> {
            let column = |set: &Self| set.windows.iter().map(|w| w[k].clone()).collect();
            compare_by(&column(yardstick), &column(real), &column(self))
        };
        Ok(Distances {
            kinetic: kind(0)?,
            kinetic_published: kind(1)?,
            geometric: kind(2)?,
        })
    }

    /// Two halves of the set, drawn at random.
    pub fn halves(&self, rng: &mut ChaCha8Rng) -> (Self, Self) {
        let mut windows = self.windows.clone();
        windows.shuffle(rng);
        let other = windows.split_off(windows.len() / 2);
        (Self { windows }, Self { windows: other })
    }
}
