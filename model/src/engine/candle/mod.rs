//! The candle engine: the layers of both networks on candle's tensors, for one
//! frame of a stream or for many at once.
//!
//! Rows are frames: [lanes * frames, dim]. Inference only: the fused layer norm
//! has no gradient. [The engines](super) says what runs here and why.

mod attention;
mod attention_bias;
mod threads;

pub(crate) use attention::{TensorAttention, TensorCache};
pub(crate) use attention_bias::{AttentionWindow, attention_bias};
pub(crate) use threads::TensorThreads;

use candle_core::{Result as TensorResult, Tensor};
use candle_nn::ops;

use crate::config::Activation;
use crate::error::ModelError;
use crate::weights::{Dtype, Weights};

/// Layer norm's epsilon, PyTorch's default.
const EPSILON: f32 = 1e-5;

pub trait TensorSource {
    /// A tensor of exactly this shape, f32 on the CPU.
    fn tensor(&self, name: &str, shape: &[usize]) -> Result<Tensor, ModelError>;
}

impl Weights<'_> {
    /// A tensor of exactly this shape, as f32 on the CPU.
    pub fn tensor(&self, name: &str, shape: &[usize]) -> Result<Tensor, ModelError> {
        let values = self.floats(name, shape)?;
        Ok(Tensor::from_vec(values, shape, &candle_core::Device::Cpu)?)
    }
}

impl TensorSource for Weights<'_> {
    fn tensor(&self, name: &str, shape: &[usize]) -> Result<Tensor, ModelError> {
        Weights::tensor(self, name, shape)
    }
}

/// Weights whose matrices have been rounded to a number format, as those that
/// the own engine multiplies with.
pub(crate) struct RoundedWeights<'a>(pub &'a Weights<'a>, pub Dtype);

impl TensorSource for RoundedWeights<'_> {
    fn tensor(&self, name: &str, shape: &[usize]) -> Result<Tensor, ModelError> {
        let Self(weights, dtype) = self;
        match *shape {
            [rows, width] => {
                let values = weights.matrix(name, rows, width, *dtype)?.floats();
                Ok(Tensor::from_vec(values, shape, &candle_core::Device::Cpu)?)
            }
            _ => weights.tensor(name, shape),
        }
    }
}

/// `x W^T + b`.
#[derive(Clone, Debug)]
pub struct TensorLinear {
    weight_t: Tensor,
    bias: Tensor,
}

impl TensorLinear {
    /// `NAME.weight` `[output, input]` and `NAME.bias` `[output]`.
    pub fn load(
        w: &impl TensorSource,
        name: &str,
        input: usize,
        output: usize,
    ) -> Result<Self, ModelError> {
        Ok(Self {
            weight_t: w.tensor(&format!("{name}.weight"), &[output, input])?.t()?,
            bias: w.tensor(&format!("{name}.bias"), &[output])?,
        })
    }

    /// Bytes of the weights, as f32.
    pub fn bytes(&self) -> usize {
        4 * (self.weight_t.elem_count() + self.bias.elem_count())
    }

    /// Rows [n, input] to rows [n, output].
    pub fn forward(&self, x: &Tensor) -> TensorResult<Tensor> {
        x.matmul(&self.weight_t)?.broadcast_add(&self.bias)
    }
}

/// Layer norm with scale and shift over the last dimension.
#[derive(Clone, Debug)]
pub struct TensorNorm {
    weight: Tensor,
    bias: Tensor,
}

impl TensorNorm {
    /// `NAME.weight` and `NAME.bias`, both `[dim]`.
    pub fn load(w: &impl TensorSource, name: &str, dim: usize) -> Result<Self, ModelError> {
        Ok(Self {
            weight: w.tensor(&format!("{name}.weight"), &[dim])?,
            bias: w.tensor(&format!("{name}.bias"), &[dim])?,
        })
    }

    /// Rows [n, dim], each normalised by itself.
    pub fn forward(&self, x: &Tensor) -> TensorResult<Tensor> {
        ops::layer_norm(x, &self.weight, &self.bias, EPSILON)
    }
}

/// Layer norm, linear layer, activation, linear layer; added to what comes in.
#[derive(Clone, Debug)]
pub(crate) struct TensorFeedForward {
    norm: TensorNorm,
    up: TensorLinear,
    down: TensorLinear,
    activation: Activation,
}

impl TensorFeedForward {
    pub fn load(
        w: &impl TensorSource,
        (norm, name): (&str, &str),
        (dim, hidden): (usize, usize),
        activation: Activation,
    ) -> Result<Self, ModelError> {
        Ok(Self {
            norm: TensorNorm::load(w, norm, dim)?,
            up: TensorLinear::load(w, &format!("{name}.up"), dim, hidden)?,
            down: TensorLinear::load(w, &format!("{name}.down"), hidden, dim)?,
            activation,
        })
    }

    pub fn bytes(&self) -> usize {
        self.up.bytes() + self.down.bytes()
    }

    pub fn forward(&self, x: &Tensor) -> TensorResult<Tensor> {
        let up = self.up.forward(&self.norm.forward(x)?)?;
        let up = match self.activation {
            Activation::Gelu => up.gelu()?,
            Activation::Relu2 => up.relu()?.sqr()?,
        };
        x + self.down.forward(&up)?
    }
}

/// The pre-norm layers of the VQ-VAE, encoder and decoder alike, between the
/// linear layers that lead in and out.
#[derive(Clone, Debug)]
pub(crate) struct TensorTransformer {
    input: TensorLinear,
    layers: Vec<(TensorAttention, TensorFeedForward)>,
    norm: TensorNorm,
    output: TensorLinear,
    /// Adds a linear map of the input.
    skip: Option<TensorLinear>,
    slopes: Vec<f32>,
    window: AttentionWindow,
}

/// Sizes of a [`TensorTransformer`].
#[derive(Clone, Debug)]
pub(crate) struct TransformerSizes {
    pub input: usize,
    pub dim: usize,
    pub ff: usize,
    pub output: usize,
    pub layers: usize,
    pub head_width: usize,
    pub slopes: Vec<f32>,
    pub window: AttentionWindow,
    pub activation: Activation,
    pub skip: bool,
}

impl TensorTransformer {
    /// The tensors whose names begin with `name`.
    pub fn load(
        w: &impl TensorSource,
        name: &str,
        sizes: TransformerSizes,
    ) -> Result<Self, ModelError> {
        let dim = sizes.dim;
        let heads = (sizes.slopes.len(), sizes.head_width);
        let layer = |i| {
            let name = format!("{name}.layers.{i}");
            let names = (&*format!("{name}.norm2"), &*format!("{name}.ff"));
            let attention = TensorAttention::load(w, (&name, false), dim, heads)?;
            let ff = TensorFeedForward::load(w, names, (dim, sizes.ff), sizes.activation)?;
            Ok((attention, ff))
        };
        let skip = || TensorLinear::load(w, &format!("{name}.skip"), sizes.input, sizes.output);
        let skip = sizes.skip.then(skip);
        Ok(Self {
            input: TensorLinear::load(w, &format!("{name}.input"), sizes.input, dim)?,
            layers: (0..sizes.layers).map(layer).collect::<Result<_, ModelError>>()?,
            norm: TensorNorm::load(w, &format!("{name}.norm"), dim)?,
            output: TensorLinear::load(w, &format!("{name}.output"), dim, sizes.output)?,
            skip: skip.transpose()?,
            slopes: sizes.slopes,
            window: sizes.window,
        })
    }

    /// Empty caches for a stream of one lane.
    pub fn start(&self, dtype: Dtype) -> Vec<TensorCache> {
        let cache = |(attention, _): &(TensorAttention, _)| {
            TensorCache::new(attention, 1, self.window, dtype)
        };
        self.layers.iter().map(cache).collect()
    }

    pub fn bytes(&self) -> usize {
        let layers = self.layers.iter().map(|(a, f)| a.bytes() + f.bytes());
        let skip = self.skip.as_ref().map_or(0, TensorLinear::bytes);
        self.input.bytes() + layers.sum::<usize>() + self.output.bytes() + skip
    }

    /// The next frames of a stream, [frames, input] to [frames, output].
    pub fn forward(&self, x: &Tensor, caches: &mut [TensorCache]) -> TensorResult<Tensor> {
        let frames = x.dim(0)?;
        let keys = frames + caches.first().map_or(0, TensorCache::frames);
        let bias = attention_bias(&self.slopes, frames, keys, self.window)?;
        let skipped = self.skip.as_ref().map(|skip| skip.forward(x)).transpose()?;
        let mut x = self.input.forward(x)?;
        for ((attention, feed_forward), cache) in self.layers.iter().zip(caches) {
            x = feed_forward.forward(&attention.forward(&x, None, &bias, cache)?)?;
        }
        let out = self.output.forward(&self.norm.forward(&x)?)?;
        match skipped {
            Some(skipped) => out + skipped,
            None => Ok(out),
        }
    }
}
