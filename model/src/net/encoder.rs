//! Stage 1's encoders: normalised motion to one code per body part and frame.
//!
//! Each part's encoder sees some frames to both sides, so this is for motion
//! that is there already (a file to send through the codes, the past that a
//! dance goes on from), not for a stream. Long motion is taken in pieces that
//! overlap by all that an encoder sees: the codes are those of one pass.

use candle_core::Tensor;

use super::attention::one_shot_bias;
use super::config::{ModelConfig, VqConfig};
use super::layers::{Layer, Linear, Norm};
use super::weights::Weights;
use crate::error::ModelError;
use crate::motion::representation::{CONTACTS_AT, JOINTS_AT, POSE_DIM, STEPS_AT};

/// Frames whose codes one piece gives.
const PIECE_FRAMES: usize = 512;

/// The encoder of one body part.
#[derive(Clone, Debug)]
struct Part {
    /// Which of the 137 numbers it sees.
    channels: Vec<usize>,
    input: Linear,
    layers: Vec<Layer>,
    norm: Norm,
    output: Linear,
    /// Codes [codes, code_dim] and the squared length of each.
    codebook_t: Tensor,
    squared: Tensor,
}

/// All encoders.
#[derive(Clone, Debug)]
pub struct VqEncoder {
    config: VqConfig,
    parts: Vec<Part>,
}

impl VqEncoder {
    /// Takes the tensors under `vq.encoder.` out of the file. A file made for
    /// dancing alone has none: the error names the first that is missing.
    pub fn load(w: &Weights) -> Result<Self, ModelError> {
        let config = w.config();
        let parts = config.parts.iter().map(|part| Part::load(w, part, config));
        Ok(Self {
            parts: parts.collect::<Result<_, _>>()?,
            config: config.vq.clone(),
        })
    }

    /// One code per part for each row of 137 normalised numbers.
    pub fn encode(&self, motion: &[[f32; POSE_DIM]]) -> Result<Vec<Vec<usize>>, ModelError> {
        let margin = self.config.encoder_window * self.config.encoder_layers;
        let mut codes = Vec::with_capacity(motion.len());
        while codes.len() < motion.len() {
            let first = codes.len();
            let from = first.saturating_sub(margin);
            let end = motion.len().min(first + PIECE_FRAMES);
            let piece = &motion[from..motion.len().min(end + margin)];
            let all = self.encode_piece(piece)?;
            codes.extend_from_slice(&all[first - from..end - from]);
        }
        Ok(codes)
    }

    fn encode_piece(&self, motion: &[[f32; POSE_DIM]]) -> Result<Vec<Vec<usize>>, ModelError> {
        let vq = &self.config;
        let window = vq.encoder_window;
        let bias = one_shot_bias(motion.len(), &vq.encoder_slopes, window, window)?;
        let mut rows = vec![Vec::with_capacity(self.parts.len()); motion.len()];
        for part in &self.parts {
            for (row, code) in rows.iter_mut().zip(part.codes(motion, &bias)?) {
                row.push(code as usize);
            }
        }
        Ok(rows)
    }
}

impl Part {
    fn load(w: &Weights, part: &str, config: &ModelConfig) -> Result<Self, ModelError> {
        let vq = &config.vq;
        let name = |rest: &str| format!("vq.encoder.{part}.{rest}");
        let channels = part_channels(part).map_err(|reason| w.config_error(reason))?;
        let dim = vq.encoder_dim;
        let heads = (vq.encoder_slopes.len(), vq.encoder_head_dim());
        let shape = [config.codes, config.code_dim];
        let codebook = w.tensor(&format!("vq.codebook.{part}"), &shape)?;
        let layers = (0..vq.encoder_layers)
            .map(|i| Layer::load(w, &name(&format!("layers.{i}")), dim, heads, 4 * dim));
        Ok(Self {
            input: Linear::load(w, &name("input"), channels.len(), dim)?,
            layers: layers.collect::<Result<_, _>>()?,
            norm: Norm::load(w, &name("norm"), dim)?,
            output: Linear::load(w, &name("output"), dim, config.code_dim)?,
            squared: codebook.sqr()?.sum(1)?,
            codebook_t: codebook.t()?,
            channels,
        })
    }

    /// The nearest code of each frame.
    fn codes(&self, motion: &[[f32; POSE_DIM]], bias: &Tensor) -> Result<Vec<u32>, ModelError> {
        let seen: Vec<f32> = motion
            .iter()
            .flat_map(|row| self.channels.iter().map(|&c| row[c]))
            .collect();
        let shape = (motion.len(), self.channels.len());
        let mut x = self
            .input
            .forward(&Tensor::from_vec(seen, shape, bias.device())?)?;
        for layer in &self.layers {
            x = layer.one_shot(&x, bias)?;
        }
        let latent = self.output.forward(&self.norm.forward(&x)?)?;
        // |z - c|^2 without |z|^2, which is the same for every code.
        let distance = self
            .squared
            .broadcast_sub(&(latent.matmul(&self.codebook_t)? * 2.0)?)?;
        Ok(distance.argmin(1)?.to_vec1()?)
    }
}

/// Names of the body parts that a codebook can be for.
const PARTS: [&str; 8] = [
    "whole",
    "lower",
    "upper",
    "trunk",
    "left_leg",
    "right_leg",
    "left_arm",
    "right_arm",
];

/// Which of the 137 numbers the encoder of a part sees; the error lists the
/// parts that there are.
pub fn part_channels(part: &str) -> Result<Vec<usize>, String> {
    let known = || {
        format!(
            "part `{part}` is unknown; expected one of: {}",
            PARTS.join(", ")
        )
    };
    channels(part).ok_or_else(known)
}

/// Which of the 137 numbers the encoder of a part sees; the same table in
/// Python is `part_channels` in `model/reference/config.py`.
fn channels(part: &str) -> Option<Vec<usize>> {
    const LEGS: [usize; 9] = [0, 1, 2, 4, 5, 7, 8, 10, 11];
    let (joints, contacts): (Vec<usize>, Vec<usize>) = match part {
        "whole" => ((0..22).collect(), vec![0, 1, 2, 3]),
        "lower" => (LEGS.to_vec(), vec![0, 1, 2, 3]),
        "upper" => ((0..22).filter(|j| !LEGS.contains(j)).collect(), vec![]),
        "trunk" => (vec![0, 1, 2, 3, 6, 9, 12, 13, 14, 15, 16, 17], vec![]),
        "left_leg" => (vec![4, 7, 10], vec![0, 1]),
        "right_leg" => (vec![5, 8, 11], vec![2, 3]),
        "left_arm" => (vec![18, 20], vec![]),
        "right_arm" => (vec![19, 21], vec![]),
        _ => return None,
    };
    let mut channels = Vec::new();
    // Whatever touches the floor also knows how the root moves.
    if !contacts.is_empty() || joints.contains(&0) {
        channels.extend(0..JOINTS_AT);
    }
    let triple = |at: usize| at..at + 3;
    for joint in joints.iter().filter(|&&j| j > 0) {
        channels.extend(triple(JOINTS_AT + 3 * (joint - 1)));
    }
    for joint in &joints {
        channels.extend(triple(STEPS_AT + 3 * joint));
    }
    channels.extend(contacts.iter().map(|c| CONTACTS_AT + c));
    Some(channels)
}
