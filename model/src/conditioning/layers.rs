//! The layers that public checkpoints have in common.

use candle_core::{Result as TensorResult, Tensor};
use candle_nn::ops;

use super::checkpoint::Checkpoint;
use crate::error::ModelError;

/// PyTorch's usual.
const EPSILON: f32 = 1e-5;

/// `x W^T + b`, as PyTorch keeps it.
#[derive(Debug)]
pub struct Linear {
    weight_t: Tensor,
    bias: Tensor,
}

impl Linear {
    /// `NAME.weight` [output, input] and `NAME.bias`.
    pub fn load(
        file: &Checkpoint,
        name: &str,
        input: usize,
        output: usize,
    ) -> Result<Self, ModelError> {
        let weight = file.tensor(&format!("{name}.weight"), &[output, input])?;
        Ok(Self {
            weight_t: weight.t()?,
            bias: file.tensor(&format!("{name}.bias"), &[output])?,
        })
    }

    /// Of rows [n, width].
    pub fn forward(&self, x: &Tensor) -> TensorResult<Tensor> {
        x.matmul(&self.weight_t)?.broadcast_add(&self.bias)
    }
}

/// Layer normalisation over the last dimension.
#[derive(Debug)]
pub struct Norm {
    weight: Tensor,
    bias: Tensor,
}

impl Norm {
    /// `NAME.weight` and `NAME.bias`.
    pub fn load(file: &Checkpoint, name: &str, width: usize) -> Result<Self, ModelError> {
        Ok(Self {
            weight: file.tensor(&format!("{name}.weight"), &[width])?,
            bias: file.tensor(&format!("{name}.bias"), &[width])?,
        })
    }

    /// Of rows [n, width].
    pub fn forward(&self, x: &Tensor) -> TensorResult<Tensor> {
        ops::layer_norm(x, &self.weight, &self.bias, EPSILON)
    }
}
