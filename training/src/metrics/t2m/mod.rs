//! The extractors that text-to-motion papers score with: motion and text as
//! points of one space, near each other where text and motion match.
//!
//! The networks of Guo et al. (T2M): two convolutions over HumanML3D's vectors
//! and a GRU in both directions over what they give; a GRU in both directions
//! over words. Their weights are not part of this program: a user brings them,
//! converted by `model/reference/convert_t2m.py` (docs/metrics.md). PyTorch made
//! the numbers that the tests compare with (`golden/make.py`).

mod gru;
mod words;

use std::path::Path;

use candle_core::{Device, Tensor};
use candle_nn::ops::leaky_relu;
use gru::{GruReader, LEAK};
use words::{KINDS, WORD_DIM, WordTable};

use crate::motion::humanml::{HUMANML_DIM, HumanMlVector};
use servodance_model::ModelError;
use servodance_model::conditioning::TensorLinear as Linear;
use servodance_model::conditioning::checkpoint::Checkpoint;

pub const POINT_DIM: usize = 512;
/// Frames of a motion that become one step; a motion's length is cut to a multiple of it.
pub const FRAMES_A_STEP: usize = 4;
pub const MOST_FRAMES: usize = 196;

const HEARD: usize = HUMANML_DIM - 4;
const MOTION_WIDTH: usize = 1024;
const KERNEL: usize = 4;

#[derive(Debug)]
pub struct Extractors {
    mean: Tensor,
    deviation: Tensor,
    convolutions: [(Tensor, Tensor); 2],
    movement: Linear,
    motion: GruReader,
    kinds: Linear,
    text: GruReader,
    words: WordTable,
}

impl Extractors {
    /// Reads `model.safetensors` and `words.json`. Fails with the file and what is wrong.
    pub fn load(folder: &Path) -> Result<Self, ModelError> {
        let file = Checkpoint::open(&folder.join("model.safetensors"))?;
        let convolution = |layer: usize, input: usize| {
            let name = |what: &str| format!("movement_encoder.main.{layer}.{what}");
            let weight = file.tensor(&name("weight"), &[POINT_DIM, input, KERNEL])?;
            let bias = file.tensor(&name("bias"), &[POINT_DIM])?;
            Ok::<_, ModelError>((weight, bias.reshape((1, POINT_DIM, 1))?))
        };
        Ok(Self {
            mean: file.tensor("mean", &[HUMANML_DIM])?,
            deviation: file.tensor("std", &[HUMANML_DIM])?,
            convolutions: [convolution(0, HEARD)?, convolution(3, POINT_DIM)?],
            movement: Linear::load(&file, "movement_encoder.out_net", POINT_DIM, POINT_DIM)?,
            motion: GruReader::load(&file, "motion_encoder", [POINT_DIM, MOTION_WIDTH, POINT_DIM])?,
            kinds: Linear::load(&file, "text_encoder.pos_emb", KINDS, WORD_DIM)?,
            text: GruReader::load(&file, "text_encoder", [WORD_DIM, POINT_DIM, POINT_DIM])?,
            words: WordTable::load(&folder.join("words.json"), &file)?,
        })
    }

    /// Points of motions, each cut to [`MOST_FRAMES`] and a multiple of [`FRAMES_A_STEP`].
    /// Fails on a motion that is too short for one step.
    pub fn motions(&self, motions: &[&[HumanMlVector]]) -> Result<Vec<Vec<f32>>, ModelError> {
        let steps = motions.iter().map(|motion| self.steps(motion));
        let steps: Vec<Tensor> = steps.collect::<Result<_, _>>()?;
        Ok(self.motion.forward(&steps)?.to_vec2()?)
    }

    /// What the convolutions make of a motion, [frames / 4, 512]. As where they
    /// were trained the motion is followed by mean frames up to the longest.
    fn steps(&self, motion: &[HumanMlVector]) -> Result<Tensor, ModelError> {
        let steps = motion.len().min(MOST_FRAMES) / FRAMES_A_STEP;
        if steps == 0 {
            return Err(ModelError::TooShort { found: motion.len(), expected: FRAMES_A_STEP });
        }
        let frames = steps * FRAMES_A_STEP;
        let rows = motion[..frames].as_flattened();
        let rows = Tensor::from_slice(rows, (frames, HUMANML_DIM), &Device::Cpu)?;
        let normal = rows
            .broadcast_sub(&self.mean)?
            .broadcast_div(&self.deviation)?
            .narrow(1, 0, HEARD)?
            .pad_with_zeros(0, 0, MOST_FRAMES - frames)?;
        let mut x = normal.t()?.unsqueeze(0)?.contiguous()?;
        for (weight, bias) in &self.convolutions {
            let next = x.conv1d(weight, 1, 2, 1, 1)?.broadcast_add(bias)?;
            x = leaky_relu(&next, LEAK)?;
        }
        let x = x.squeeze(0)?.t()?.narrow(0, 0, steps)?.contiguous()?;
        Ok(self.movement.forward(&x)?)
    }

    /// Points of texts, each as its tokens `word/KIND`.
    pub fn texts(&self, texts: &[&[&str]]) -> Result<Vec<Vec<f32>>, ModelError> {
        let one = |tokens: &&[&str]| -> Result<Tensor, ModelError> {
            let (vectors, kinds) = self.words.of(tokens)?;
            Ok((vectors + self.kinds.forward(&kinds)?)?)
        };
        let sequences: Vec<Tensor> = texts.iter().map(one).collect::<Result<_, _>>()?;
        Ok(self.text.forward(&sequences)?.to_vec2()?)
    }
}

#[cfg(test)]
mod tests;
