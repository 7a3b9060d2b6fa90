//! Linear, layer norm, feed-forward, and the pre-norm layer of stage 1 in candle:
//! weights out of the file, one call each.
//!
//! For all frames at once, inference only: the fused layer norm used here has no gradient.

use candle_core::{Result as TensorResult, Tensor};
use candle_nn::ops;

use super::attention::SelfAttention;
use super::config::Activation;
use super::weights::Weights;
use crate::error::ModelError;

/// Layer norm's epsilon, PyTorch's default.
const EPSILON: f32 = 1e-5;

/// `x W^T + b`.
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    weight_t: Tensor,
    bias: Tensor,
}

impl Linear {
    pub fn load(w: &Weights, name: &str, input: usize, output: usize) -> Result<Self, ModelError> {
        Ok(Self {
            weight_t: w.tensor(&format!("{name}.weight"), &[output, input])?.t()?,
            bias: w.tensor(&format!("{name}.bias"), &[output])?,
        })
    }

    /// Rows [n, input] to rows [n, output].
    pub fn forward(&self, x: &Tensor) -> TensorResult<Tensor> {
        x.matmul(&self.weight_t)?.broadcast_add(&self.bias)
    }
}

/// Layer norm with scale and shift.
#[derive(Clone, Debug)]
pub(crate) struct Norm {
    weight: Tensor,
    bias: Tensor,
}

impl Norm {
    pub fn load(w: &Weights, name: &str, dim: usize) -> Result<Self, ModelError> {
        Ok(Self {
            weight: w.tensor(&format!("{name}.weight"), &[dim])?,
            bias: w.tensor(&format!("{name}.bias"), &[dim])?,
        })
    }

    pub fn forward(&self, x: &Tensor) -> TensorResult<Tensor> {
        ops::layer_norm(x, &self.weight, &self.bias, EPSILON)
    }
}

/// Two linear layers with an activation between them.
#[derive(Clone, Debug)]
pub(crate) struct FeedForward {
    up: Linear,
    down: Linear,
    activation: Activation,
}

impl FeedForward {
    pub fn load(w: &Weights, name: &str, dim: usize, hidden: usize) -> Result<Self, ModelError> {
        Ok(Self {
            up: Linear::load(w, &format!("{name}.up"), dim, hidden)?,
            down: Linear::load(w, &format!("{name}.down"), hidden, dim)?,
            activation: w.config().activation,
        })
    }

    pub fn forward(&self, x: &Tensor) -> TensorResult<Tensor> {
        let x = self.up.forward(x)?;
        let x = match self.activation {
            Activation::Gelu => x.gelu()?,
            Activation::Relu2 => x.relu()?.sqr()?,
        };
        self.down.forward(&x)
    }
}

/// A pre-norm layer of stage 1: self-attention, then feed-forward.
#[derive(Clone, Debug)]
pub(crate) struct Layer {
    norm1: Norm,
    attention: SelfAttention,
    norm2: Norm,
    feed_forward: FeedForward,
}

impl Layer {
    pub fn load(
        w: &Weights,
        name: &str,
        dim: usize,
        heads: (usize, usize),
        hidden: usize,
    ) -> Result<Self, ModelError> {
        Ok(Self {
            norm1: Norm::load(w, &format!("{name}.norm1"), dim)?,
            attention: SelfAttention::load(w, &format!("{name}.attn"), dim, heads)?,
            norm2: Norm::load(w, &format!("{name}.norm2"), dim)?,
            feed_forward: FeedForward::load(w, &format!("{name}.ff"), dim, hidden)?,
        })
    }

    /// All frames [n, dim] at once.
    pub fn one_shot(&self, x: &Tensor, bias: &Tensor) -> TensorResult<Tensor> {
        let attended = self.attention.one_shot(&self.norm1.forward(x)?, bias)?;
        self.feed(&(x + attended)?)
    }

    fn feed(&self, x: &Tensor) -> TensorResult<Tensor> {
        x + self.feed_forward.forward(&self.norm2.forward(x)?)?
    }
}
