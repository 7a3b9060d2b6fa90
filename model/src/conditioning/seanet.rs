//! Encodec's encoder (SEANet), streaming: convolutions that keep what the next
//! samples will overlap with, and an LSTM that keeps its state.
//!
//! The same numbers whether a recording comes at once or in pieces; memory does
//! not grow. Where the stream begins every convolution reflects its input to
//! the left, as the original does; for that the first piece must hold
//! [`FIRST_FRAMES`] frames. candle-transformers has these layers too, without
//! reflection and without a state.

use candle_core::{D, Device, Result as TensorResult, Tensor};
use candle_nn::ops::sigmoid;

use super::checkpoint::Checkpoint;
use crate::error::ModelError;

/// Samples a frame: the product of [`STRIDES`].
pub(super) const HOP: usize = 320;
/// Frames that the first piece must hold: the last convolution reflects six.
pub(super) const FIRST_FRAMES: usize = 7;
/// By how much each stage shortens its input.
const STRIDES: [usize; 4] = [2, 4, 5, 8];
/// Kernels of the outermost convolutions, and of those within blocks.
const KERNEL: usize = 7;
const BLOCK_KERNEL: usize = 3;
const LSTM_LAYERS: usize = 2;

/// A causal convolution over time, [1, channels, samples].
#[derive(Clone, Debug)]
struct Conv {
    weight: Tensor,
    bias: Tensor,
    stride: usize,
    /// Input samples that every output shares with the one before.
    overlap: usize,
    /// The last of them; none before the first piece.
    past: Option<Tensor>,
}

impl Conv {
    fn load(
        file: &Checkpoint,
        name: &str,
        [input, output, kernel]: [usize; 3],
        stride: usize,
    ) -> Result<Self, ModelError> {
        let bias = file.tensor(&format!("{name}.conv.bias"), &[output])?;
        Ok(Self {
            weight: normed_weight(file, &format!("{name}.conv"), [output, input, kernel])?,
            bias: bias.reshape((1, output, 1))?,
            stride,
            overlap: kernel - stride,
            past: None,
        })
    }

    /// A piece whose length is a multiple of the stride.
    fn forward(&mut self, piece: &Tensor) -> TensorResult<Tensor> {
        let mut input = piece.clone();
        if self.overlap > 0 {
            let before = match self.past.take() {
                Some(past) => past,
                // x[overlap], ..., x[1] in front of x[0].
                None => piece.narrow(2, 1, self.overlap)?.contiguous()?.flip(&[2])?,
            };
            input = Tensor::cat(&[&before, piece], 2)?;
            let end = input.dim(2)? - self.overlap;
            // A copy: a view would keep the whole piece alive.
            self.past = Some(input.narrow(2, end, self.overlap)?.force_contiguous()?);
        }
        input.conv1d(&self.weight, 0, self.stride, 1, 1)?.broadcast_add(&self.bias)
    }
}

/// A weight kept as length and direction: `g v / |v|`, the norm over all but
/// the first dimension. Older files say `weight_g` and `weight_v`, newer ones
/// `parametrizations.weight.original0` and `original1`.
fn normed_weight(file: &Checkpoint, name: &str, shape: [usize; 3]) -> Result<Tensor, ModelError> {
    let newer = format!("{name}.parametrizations.weight.original");
    let [length, direction] = match file.has(&format!("{newer}0")) {
        true => [format!("{newer}0"), format!("{newer}1")],
        false => [format!("{name}.weight_g"), format!("{name}.weight_v")],
    };
    let length = file.tensor(&length, &[shape[0], 1, 1])?;
    let direction = file.tensor(&direction, &shape)?;
    let norm = direction.sqr()?.sum_keepdim((1, 2))?.sqrt()?;
    Ok(direction.broadcast_mul(&length.div(&norm)?)?)
}

/// Two convolutions around which the input is led by a third.
#[derive(Clone, Debug)]
struct Block {
    first: Conv,
    second: Conv,
    shortcut: Conv,
}

impl Block {
    fn load(file: &Checkpoint, name: &str, width: usize) -> Result<Self, ModelError> {
        let conv = |name: String, shape| Conv::load(file, &name, shape, 1);
        let half = width / 2;
        Ok(Self {
            first: conv(format!("{name}.block.1"), [width, half, BLOCK_KERNEL])?,
            second: conv(format!("{name}.block.3"), [half, width, 1])?,
            shortcut: conv(format!("{name}.shortcut"), [width, width, 1])?,
        })
    }

    fn forward(&mut self, x: &Tensor) -> TensorResult<Tensor> {
        let inner = self.first.forward(&x.elu(1.0)?)?.elu(1.0)?;
        self.shortcut.forward(x)? + self.second.forward(&inner)?
    }
}

/// One layer of the LSTM over frames [n, width].
#[derive(Clone, Debug)]
struct Lstm {
    input_t: Tensor,
    recurrent_t: Tensor,
    bias: Tensor,
    hidden: Tensor,
    cell: Tensor,
}

impl Lstm {
    fn load(file: &Checkpoint, name: &str, width: usize, layer: usize) -> Result<Self, ModelError> {
        let get = |what: &str, shape: &[usize]| {
            file.tensor(&format!("{name}.lstm.{what}_l{layer}"), shape)
        };
        let square = [4 * width, width];
        let biases = get("bias_ih", &square[..1])? + get("bias_hh", &square[..1])?;
        let zeros = Tensor::zeros((1, width), candle_core::DType::F32, &Device::Cpu)?;
        Ok(Self {
            input_t: get("weight_ih", &square)?.t()?,
            recurrent_t: get("weight_hh", &square)?.t()?,
            bias: biases?,
            hidden: zeros.clone(),
            cell: zeros,
        })
    }

    fn forward(&mut self, frames: &Tensor) -> TensorResult<Tensor> {
        let driven = frames.matmul(&self.input_t)?.broadcast_add(&self.bias)?;
        let mut outputs = Vec::with_capacity(frames.dim(0)?);
        for frame in 0..frames.dim(0)? {
            let gates = (driven.narrow(0, frame, 1)? + self.hidden.matmul(&self.recurrent_t)?)?;
            let gates = gates.chunk(4, D::Minus1)?;
            let (keep, open) = (sigmoid(&gates[1])?, sigmoid(&gates[0])?);
            self.cell = ((keep * &self.cell)? + (open * gates[2].tanh()?)?)?;
            self.hidden = (sigmoid(&gates[3])? * self.cell.tanh()?)?;
            outputs.push(self.hidden.clone());
        }
        Tensor::cat(&outputs, 0)
    }
}

/// The whole encoder with what it remembers. Clone a fresh one for each stream.
#[derive(Clone, Debug)]
pub(super) struct Encoder {
    first: Conv,
    stages: Vec<(Block, Conv)>,
    lstm: Vec<Lstm>,
    last: Conv,
}

impl Encoder {
    /// Of a checkpoint with so many filters in its first layer.
    pub fn load(file: &Checkpoint, filters: usize, latent: usize) -> Result<Self, ModelError> {
        // Activations count as layers in the names.
        let name = |layer: usize| format!("encoder.layers.{layer}");
        let first = Conv::load(file, &name(0), [1, filters, KERNEL], 1)?;
        let mut width = filters;
        let mut stages = Vec::new();
        for (number, stride) in STRIDES.into_iter().enumerate() {
            let block = Block::load(file, &name(1 + 3 * number), width)?;
            let shape = [width, 2 * width, 2 * stride];
            let down = Conv::load(file, &name(3 + 3 * number), shape, stride)?;
            stages.push((block, down));
            width *= 2;
        }
        let lstm = (0..LSTM_LAYERS).map(|layer| Lstm::load(file, &name(13), width, layer));
        Ok(Self {
            first,
            stages,
            lstm: lstm.collect::<Result<_, _>>()?,
            last: Conv::load(file, &name(15), [width, latent, KERNEL], 1)?,
        })
    }

    /// Latents [frames, latent] of the next `frames * HOP` samples; the first
    /// time at least [`FIRST_FRAMES`] frames.
    pub fn forward(&mut self, samples: &[f32]) -> TensorResult<Tensor> {
        let piece = Tensor::from_slice(samples, (1, 1, samples.len()), &Device::Cpu)?;
        let mut x = self.first.forward(&piece)?;
        for (block, down) in &mut self.stages {
            x = down.forward(&block.forward(&x)?.elu(1.0)?)?;
        }
        let frames = x.squeeze(0)?.t()?.contiguous()?;
        let mut inner = frames.clone();
        for layer in &mut self.lstm {
            inner = layer.forward(&inner)?;
        }
        let x = (inner + frames)?.t()?.unsqueeze(0)?.contiguous()?.elu(1.0)?;
        self.last.forward(&x)?.squeeze(0)?.t()?.contiguous()
    }
}
