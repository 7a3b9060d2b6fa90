//! Attention with ALiBi in candle, over all frames at once. A frame at a time:
//! [`engine`](super::engine).

use candle_core::{Device, Result as TensorResult, Tensor};
use candle_nn::ops;

use super::layers::Linear;
use super::weights::Weights;
use crate::error::ModelError;

/// Bias [heads, length, length] for one pass: frame i sees j when
/// `i - window < j <= i + ahead`.
pub(crate) fn one_shot_bias(
    length: usize,
    slopes: &[f32],
    window: usize,
    ahead: usize,
) -> TensorResult<Tensor> {
    let mut bias = Vec::with_capacity(slopes.len() * length * length);
    for slope in slopes {
        for i in 0..length {
            for j in 0..length {
                let seen = j <= i + ahead && j + window > i;
                bias.push(if seen {
                    -slope * i.abs_diff(j) as f32
                } else {
                    f32::NEG_INFINITY
                });
            }
        }
    }
    Tensor::from_vec(bias, (slopes.len(), length, length), &Device::Cpu)
}

/// Rows [n, parts * dim] to `parts` tensors [heads, n, width], contiguous.
fn split_heads(x: &Tensor, parts: usize, heads: usize) -> TensorResult<Vec<Tensor>> {
    let (rows, wide) = x.dims2()?;
    let x = x.reshape((rows, parts, heads, wide / parts / heads))?;
    (0..parts)
        .map(|p| x.narrow(1, p, 1)?.squeeze(1)?.transpose(0, 1)?.contiguous())
        .collect()
}

/// Softmax attention: queries [heads, n, width] to rows [n, dim].
fn attend(q: &Tensor, keys: &Tensor, values: &Tensor, bias: &Tensor) -> TensorResult<Tensor> {
    let (heads, rows, width) = q.dims3()?;
    let q = (q * (width as f64).powf(-0.5))?;
    let scores = (q.matmul(&keys.t()?)? + bias)?;
    let mixed = ops::softmax_last_dim(&scores)?.matmul(values)?;
    mixed.transpose(0, 1)?.reshape((rows, heads * width))
}

/// Self-attention: queries, keys and values of one stream.
#[derive(Clone, Debug)]
pub(crate) struct SelfAttention {
    heads: usize,
    qkv: Linear,
    out: Linear,
}

impl SelfAttention {
    /// `(heads, width)`: how many, and how wide each.
    pub fn load(
        w: &Weights,
        name: &str,
        dim: usize,
        (heads, width): (usize, usize),
    ) -> Result<Self, ModelError> {
        let wide = heads * width;
        Ok(Self {
            heads,
            qkv: Linear::load(w, &format!("{name}.qkv"), dim, 3 * wide)?,
            out: Linear::load(w, &format!("{name}.out"), wide, dim)?,
        })
    }

    /// All frames [n, dim] at once.
    pub fn one_shot(&self, x: &Tensor, bias: &Tensor) -> TensorResult<Tensor> {
        let parts = split_heads(&self.qkv.forward(x)?, 3, self.heads)?;
        self.out
            .forward(&attend(&parts[0], &parts[1], &parts[2], bias)?)
    }
}

/// Cross-attention: queries from the motion, keys and values from the music.
#[derive(Clone, Debug)]
pub(crate) struct CrossAttention {
    heads: usize,
    q: Linear,
    kv: Linear,
    out: Linear,
}

impl CrossAttention {
    /// `(heads, width)`: how many, and how wide each.
    pub fn load(
        w: &Weights,
        name: &str,
        dim: usize,
        (heads, width): (usize, usize),
    ) -> Result<Self, ModelError> {
        let wide = heads * width;
        Ok(Self {
            heads,
            q: Linear::load(w, &format!("{name}.q"), dim, wide)?,
            kv: Linear::load(w, &format!("{name}.kv"), dim, 2 * wide)?,
            out: Linear::load(w, &format!("{name}.out"), wide, dim)?,
        })
    }

    /// All frames [n, dim] with all music [n, dim] at once.
    pub fn one_shot(&self, x: &Tensor, music: &Tensor, bias: &Tensor) -> TensorResult<Tensor> {
        let kv = split_heads(&self.kv.forward(music)?, 2, self.heads)?;
        let q = split_heads(&self.q.forward(x)?, 1, self.heads)?;
        self.out.forward(&attend(&q[0], &kv[0], &kv[1], bias)?)
    }
}
