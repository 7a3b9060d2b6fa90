//! The loss of the VQ-VAE between a reconstruction and the motion it was made
//! from, and its gradient.
//!
//! Huber on every number, and by weight: joint positions once more, velocities
//! (how far every joint moves over the floor to the next frame; standing feet
//! count most, they must not slide) and changes of velocity. All are means over
//! real frames, in standard deviations. The same in Python:
//! `model/reference/losses.py`.

use std::ops::Range;

use rayon::prelude::*;
use servodance_types::JOINT_COUNT;

use crate::train::autodiff::tape::Batch;
use servodance_model::motion::representation::{CONTACTS_AT, JOINTS_AT, POSE_DIM, STEPS_AT};

/// Where the root's height and the joint positions are.
const POSITIONS: Range<usize> = JOINTS_AT - 1..STEPS_AT;
/// The joints of the four contact channels.
const FEET: [usize; 4] = [7, 10, 8, 11];
/// How much more a foot counts than another joint.
const FOOT_WEIGHT: f32 = 3.0;

/// Weights of the terms beside Huber, which counts 1.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)] // docs/training.md has a table of them
pub struct LossWeights {
    pub position: f32,
    pub velocity: f32,
    /// Extra weight of standing feet within the velocities.
    pub slide: f32,
    pub jerk: f32,
    /// How far latents are from their codes (beta of eq. 3).
    pub commit: f32,
}

impl Default for LossWeights {
    fn default() -> Self {
        Self { position: 0.0, velocity: 0.5, slide: 6.0, jerk: 0.1, commit: 0.2 }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct MotionLossTerms {
    pub huber: f64,
    pub position: f64,
    pub velocity: f64,
    pub jerk: f64,
}

impl MotionLossTerms {
    /// Adds other terms, each times `weight`.
    pub fn add(&mut self, other: &Self, weight: f64) {
        self.huber += weight * other.huber;
        self.position += weight * other.position;
        self.velocity += weight * other.velocity;
        self.jerk += weight * other.jerk;
    }

    pub fn weighted(&self, weights: &LossWeights) -> f64 {
        self.huber
            + f64::from(weights.position) * self.position
            + f64::from(weights.velocity) * self.velocity
            + f64::from(weights.jerk) * self.jerk
    }
}

#[derive(Clone, Debug)]
pub(crate) struct MotionLoss {
    pub mean: Vec<f32>,
    pub std: Vec<f32>,
    pub weights: LossWeights,
    channel_weights: Vec<f32>,
}

type Joints = [[f32; 3]; JOINT_COUNT];

impl MotionLoss {
    pub fn new(mean: Vec<f32>, std: Vec<f32>, weights: LossWeights) -> Self {
        // Root channels are 4 of 137, but they move the whole body.
        let mut channel_weights = vec![1.0; POSE_DIM];
        channel_weights[..3].fill(6.0);
        channel_weights[3] = 3.0;
        channel_weights[STEPS_AT..CONTACTS_AT].fill(0.5);
        let even = channel_weights.iter().sum::<f32>() / POSE_DIM as f32;
        channel_weights.iter_mut().for_each(|w| *w /= even);
        Self { mean, std, weights, channel_weights }
    }

    pub fn normalised(&self, real: &[f32]) -> Vec<f32> {
        let of_row = |row: &[f32]| -> Vec<f32> {
            (0..POSE_DIM).map(|c| (row[c] - self.mean[c]) / self.std[c]).collect()
        };
        real.chunks(POSE_DIM).flat_map(of_row).collect()
    }

    /// Metres and radians again.
    pub fn restored(&self, normal: &[f32]) -> Vec<f32> {
        let of_row = |row: &[f32]| -> Vec<f32> {
            (0..POSE_DIM).map(|c| row[c] * self.std[c] + self.mean[c]).collect()
        };
        normal.chunks(POSE_DIM).flat_map(of_row).collect()
    }

    /// The terms, and the gradient of their weighted sum by the normalised `out` [rows, 137].
    pub fn evaluate(
        &self,
        out: &[f32],
        real: &[f32],
        batch: &Batch,
    ) -> (MotionLossTerms, Vec<f32>) {
        let mut gradient = vec![0.0; out.len()];
        let sequence = batch.length * POSE_DIM;
        let count = |less: usize| -> f64 {
            let frames = batch.lengths.iter().map(|real| real.saturating_sub(less));
            frames.sum::<usize>().max(1) as f64
        };
        let means = MotionLossCounts {
            frames: count(0) * POSE_DIM as f64,
            positions: count(0) * POSITIONS.len() as f64,
            pairs: count(1) * (3 * JOINT_COUNT) as f64,
            triples: count(2) * (3 * JOINT_COUNT) as f64,
        };
        let terms: Vec<MotionLossTerms> = gradient
            .par_chunks_mut(sequence)
            .zip(out.par_chunks(sequence))
            .zip(real.par_chunks(sequence))
            .zip(batch.lengths.par_iter())
            .map(|(((gradient, out), real), &frames)| {
                let part = ..frames * POSE_DIM;
                self.of_sequence(&out[part], &real[part], &mut gradient[part], &means)
            })
            .collect();
        let mut sum = MotionLossTerms::default();
        terms.iter().for_each(|terms| sum.add(terms, 1.0));
        (sum, gradient)
    }

    fn of_sequence(
        &self,
        out: &[f32],
        real: &[f32],
        gradient: &mut [f32],
        means: &MotionLossCounts,
    ) -> MotionLossTerms {
        let mut terms = MotionLossTerms::default();
        let goal = self.normalised(real);
        let rows = out.chunks(POSE_DIM).zip(goal.chunks(POSE_DIM));
        for ((out, goal), gradient) in rows.zip(gradient.chunks_mut(POSE_DIM)) {
            for c in 0..POSE_DIM {
                let (value, slope) = smooth_l1(out[c] - goal[c]);
                let weight = self.channel_weights[c];
                terms.huber += f64::from(weight * value) / means.frames;
                gradient[c] += slope * weight / means.frames as f32;
                if POSITIONS.contains(&c) {
                    terms.position += f64::from(value) / means.positions;
                    gradient[c] += self.weights.position * slope / means.positions as f32;
                }
            }
        }
        self.motion_terms(out, real, gradient, means, &mut terms);
        terms
    }

    fn motion_terms(
        &self,
        out: &[f32],
        real: &[f32],
        gradient: &mut [f32],
        means: &MotionLossCounts,
        terms: &mut MotionLossTerms,
    ) {
        // Metres a frame: the scale of every velocity.
        let speed = self.std[STEPS_AT];
        let found = self.restored(out);
        let (moved, goal) = (displacements(&found), displacements(real));
        let apart = |t: usize, j: usize, k: usize| (moved[t][j][k] - goal[t][j][k]) / speed;
        let mut pull = vec![Joints::default(); moved.len()];
        let coordinates = |t| (0..3 * JOINT_COUNT).map(move |c| (t, c / 3, c % 3));
        for (t, j, k) in (0..moved.len()).flat_map(coordinates) {
            let weight = self.foot_weight(real, t, j);
            let (value, slope) = smooth_l1(apart(t, j, k));
            terms.velocity += f64::from(weight * value) / means.pairs;
            let scale = means.pairs as f32 * speed;
            pull[t][j][k] += self.weights.velocity * weight * slope / scale;
            if t + 1 < moved.len() {
                let (value, slope) = smooth_l1(apart(t + 1, j, k) - apart(t, j, k));
                terms.jerk += f64::from(value) / means.triples;
                let share = self.weights.jerk * slope / (means.triples as f32 * speed);
                pull[t + 1][j][k] += share;
                pull[t][j][k] -= share;
            }
        }
        for (t, pull) in pull.iter().enumerate() {
            let (now, next) = gradient[t * POSE_DIM..(t + 2) * POSE_DIM].split_at_mut(POSE_DIM);
            self.pull_back(&found[t * POSE_DIM..][..POSE_DIM], pull, now, next);
        }
    }

    fn foot_weight(&self, real: &[f32], t: usize, joint: usize) -> f32 {
        let Some(foot) = FEET.iter().position(|j| *j == joint) else {
            return 1.0;
        };
        let contact = |t: usize| real[t * POSE_DIM + CONTACTS_AT + foot];
        FOOT_WEIGHT + self.weights.slide * contact(t) * contact(t + 1)
    }

    /// From the gradient by a displacement to those by its two frames.
    fn pull_back(&self, frame: &[f32], pull: &Joints, now: &mut [f32], next: &mut [f32]) {
        let joints = joints(frame);
        let (sin, cos) = (2.0 * frame[0]).sin_cos();
        let add = |to: &mut [f32], c: usize, g: f32| to[c] += g * self.std[c];
        for (j, g) in pull.iter().enumerate() {
            let [x, _, z] = joints[j];
            let turned = g[0] * (cos * z - sin * x) - g[2] * (sin * z + cos * x);
            add(now, 0, -2.0 * turned);
            add(now, 1, g[0]);
            add(now, 2, g[2]);
            let back = [cos * g[0] - sin * g[2], g[1], sin * g[0] + cos * g[2]];
            for k in 0..3 {
                if let Some(c) = channel(j, k) {
                    add(now, c, -back[k]);
                    add(next, c, g[k]);
                }
            }
        }
    }
}

struct MotionLossCounts {
    frames: f64,
    positions: f64,
    pairs: f64,
    triples: f64,
}

/// Smooth L1 with its kink at 1, and its slope.
fn smooth_l1(d: f32) -> (f32, f32) {
    match d.abs() < 1.0 {
        true => (0.5 * d * d, d),
        false => (d.abs() - 0.5, d.signum()),
    }
}

/// Which number holds a joint's coordinate; the root has but its height.
fn channel(joint: usize, axis: usize) -> Option<usize> {
    match (joint, axis) {
        (0, 1) => Some(JOINTS_AT - 1),
        (0, _) => None,
        _ => Some(JOINTS_AT + 3 * (joint - 1) + axis),
    }
}

/// Joints seen from the heading, metres.
pub(crate) fn joints(frame: &[f32]) -> Joints {
    std::array::from_fn(|j| std::array::from_fn(|k| channel(j, k).map_or(0.0, |c| frame[c])))
}

/// How far every joint moves over the floor to the next frame, metres, in the next frame's heading.
pub(crate) fn displacements(motion: &[f32]) -> Vec<Joints> {
    let frames: Vec<&[f32]> = motion.chunks(POSE_DIM).collect();
    frames
        .windows(2)
        .map(|pair| {
            let (before, after) = (joints(pair[0]), joints(pair[1]));
            let (sin, cos) = (2.0 * pair[0][0]).sin_cos();
            std::array::from_fn(|j| {
                let ([x, y, z], to) = (before[j], after[j]);
                [
                    to[0] + pair[0][1] - (cos * x + sin * z),
                    to[1] - y,
                    to[2] + pair[0][2] - (cos * z - sin * x),
                ]
            })
        })
        .collect()
}
