//! A bidirectional GRU that reads sequences of any lengths side by side, and
//! what is made of its two last states. Gates as PyTorch orders them: reset,
//! update, new.

use candle_core::{D, Device, Result as TensorResult, Tensor};
use candle_nn::ops::{leaky_relu, sigmoid};

use servodance_model::ModelError;
use servodance_model::conditioning::checkpoint::Checkpoint;
use servodance_model::conditioning::{TensorLinear as Linear, TensorNorm as Norm};

/// Slope below zero of every leaky ReLU here.
pub(super) const LEAK: f64 = 0.2;

#[derive(Debug)]
struct GruDirection {
    input_t: Tensor,
    input_bias: Tensor,
    recurrent_t: Tensor,
    recurrent_bias: Tensor,
    /// The state before the first step, [1, width].
    start: Tensor,
}

impl GruDirection {
    fn load(
        file: &Checkpoint,
        name: &str,
        width: usize,
        backwards: bool,
    ) -> Result<Self, ModelError> {
        let suffix = if backwards { "_reverse" } else { "" };
        let get = |what: &str, shape: &[usize]| {
            file.tensor(&format!("{name}.gru.{what}_l0{suffix}"), shape)
        };
        let square = [3 * width, width];
        let starts = file.tensor(&format!("{name}.hidden"), &[2, 1, width])?;
        Ok(Self {
            input_t: get("weight_ih", &square)?.t()?,
            input_bias: get("bias_ih", &square[..1])?,
            recurrent_t: get("weight_hh", &square)?.t()?,
            recurrent_bias: get("bias_hh", &square[..1])?,
            start: starts.get(usize::from(backwards))?,
        })
    }

    /// The state after the last element of each sequence, [count, width].
    fn last(&self, sequences: &[Tensor]) -> TensorResult<Tensor> {
        let (count, width) = (sequences.len(), self.start.dim(1)?);
        let lengths: Vec<usize> =
            sequences.iter().map(|s| s.dim(0)).collect::<TensorResult<_>>()?;
        let driven = |s: &Tensor| s.matmul(&self.input_t)?.broadcast_add(&self.input_bias);
        let driven: Vec<Tensor> = sequences.iter().map(driven).collect::<TensorResult<_>>()?;
        let mut state = self.start.broadcast_as((count, width))?.contiguous()?;
        for step in 0..lengths.iter().copied().max().unwrap_or(0) {
            let row = |i: usize| driven[i].narrow(0, step.min(lengths[i] - 1), 1);
            let rows: Vec<Tensor> = (0..count).map(row).collect::<TensorResult<_>>()?;
            let next = self.next(&Tensor::cat(&rows, 0)?, &state)?;
            let goes_on: Vec<u8> = lengths.iter().map(|n| u8::from(step < *n)).collect();
            let goes_on = Tensor::from_vec(goes_on, (count, 1), &Device::Cpu)?;
            state = goes_on.broadcast_as((count, width))?.where_cond(&next, &state)?;
        }
        Ok(state)
    }

    fn next(&self, driven: &Tensor, state: &Tensor) -> TensorResult<Tensor> {
        let recurrent = state.matmul(&self.recurrent_t)?.broadcast_add(&self.recurrent_bias)?;
        let (driven, recurrent) = (driven.chunk(3, D::Minus1)?, recurrent.chunk(3, D::Minus1)?);
        let reset = sigmoid(&(&driven[0] + &recurrent[0])?)?;
        let keep = sigmoid(&(&driven[1] + &recurrent[1])?)?;
        let new = (&driven[2] + (reset * &recurrent[2])?)?.tanh()?;
        &new + (keep * (state - &new)?)?
    }
}

#[derive(Debug)]
pub(super) struct GruReader {
    input: Linear,
    directions: [GruDirection; 2],
    inner: Linear,
    norm: Norm,
    output: Linear,
}

impl GruReader {
    /// The tensors whose names begin with `name`.
    pub fn load(
        file: &Checkpoint,
        name: &str,
        [input, width, output]: [usize; 3],
    ) -> Result<Self, ModelError> {
        let out = |layer: usize| format!("{name}.output_net.{layer}");
        Ok(Self {
            input: Linear::load(file, &format!("{name}.input_emb"), input, width)?,
            directions: [
                GruDirection::load(file, name, width, false)?,
                GruDirection::load(file, name, width, true)?,
            ],
            inner: Linear::load(file, &out(0), 2 * width, width)?,
            norm: Norm::load(file, &out(1), width)?,
            output: Linear::load(file, &out(3), width, output)?,
        })
    }

    /// Of sequences [length, input], none of them empty: [count, output].
    pub fn forward(&self, sequences: &[Tensor]) -> TensorResult<Tensor> {
        let ahead: Vec<Tensor> =
            sequences.iter().map(|s| self.input.forward(s)).collect::<TensorResult<_>>()?;
        let back: Vec<Tensor> = ahead.iter().map(|s| s.flip(&[0])).collect::<TensorResult<_>>()?;
        let [first, second] = &self.directions;
        let ends = Tensor::cat(&[first.last(&ahead)?, second.last(&back)?], 1)?;
        let inner = self.norm.forward(&self.inner.forward(&ends)?)?;
        self.output.forward(&leaky_relu(&inner, LEAK)?)
    }
}
