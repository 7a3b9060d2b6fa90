//! Attention with ALiBi, over everything at once or over a rotating cache.
//!
//! A cache holds the keys and values of the last `window` frames in a ring.
//! Order inside it does not matter: the bias, made once a frame for all
//! layers, gives each slot its age. Slots never written are masked out.

use candle_core::{DType, Device, Result as TensorResult, Tensor};
use candle_nn::ops;

use super::layers::Linear;
use super::weights::Weights;
use crate::error::ModelError;

/// Which slot of the rings is written now, and how old the others are.
#[derive(Clone, Debug)]
pub(crate) struct RingClock {
    window: usize,
    frames: u64,
}

impl RingClock {
    pub fn new(window: usize) -> Self {
        Self { window, frames: 0 }
    }

    /// The slot of the frame that is being processed.
    pub fn slot(&self) -> usize {
        (self.frames % self.window as u64) as usize
    }

    /// To the next frame.
    pub fn advance(&mut self) {
        self.frames += 1;
    }

    /// Bias [heads, 1, window] for the frame that is being processed.
    pub fn bias(&self, slopes: &[f32]) -> TensorResult<Tensor> {
        let (slot, window) = (self.slot(), self.window);
        let ages: Vec<usize> = (0..window).map(|s| (slot + window - s) % window).collect();
        let bias: Vec<f32> = slopes
            .iter()
            .flat_map(|slope| {
                ages.iter()
                    .map(move |&age| match age as u64 <= self.frames {
                        true => -slope * age as f32,
                        false => f32::NEG_INFINITY,
                    })
            })
            .collect();
        Tensor::from_vec(bias, (slopes.len(), 1, window), &Device::Cpu)
    }
}

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

/// Keys and values of one layer, [heads, window, width] each. Written in place,
/// so there is no `Clone`: a copy would share the numbers.
#[derive(Debug)]
pub(crate) struct Ring {
    keys: Tensor,
    values: Tensor,
}

impl Ring {
    pub fn new(heads: usize, window: usize, dim: usize) -> TensorResult<Self> {
        let shape = (heads, window, dim / heads);
        Ok(Self {
            keys: Tensor::zeros(shape, DType::F32, &Device::Cpu)?,
            values: Tensor::zeros(shape, DType::F32, &Device::Cpu)?,
        })
    }

    fn write(&self, slot: usize, keys: &Tensor, values: &Tensor) -> TensorResult<()> {
        self.keys.slice_set(keys, 1, slot)?;
        self.values.slice_set(values, 1, slot)
    }
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
    pub fn load(w: &Weights, name: &str, dim: usize, heads: usize) -> Result<Self, ModelError> {
        Ok(Self {
            heads,
            qkv: Linear::load(w, &format!("{name}.qkv"), dim, 3 * dim)?,
            out: Linear::load(w, &format!("{name}.out"), dim, dim)?,
        })
    }

    /// One frame [1, dim]; writes its key and value into the ring first.
    pub fn step(
        &self,
        x: &Tensor,
        ring: &Ring,
        slot: usize,
        bias: &Tensor,
    ) -> TensorResult<Tensor> {
        let parts = split_heads(&self.qkv.forward(x)?, 3, self.heads)?;
        ring.write(slot, &parts[1], &parts[2])?;
        self.out
            .forward(&attend(&parts[0], &ring.keys, &ring.values, bias)?)
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
    pub fn load(w: &Weights, name: &str, dim: usize, heads: usize) -> Result<Self, ModelError> {
        Ok(Self {
            heads,
            q: Linear::load(w, &format!("{name}.q"), dim, dim)?,
            kv: Linear::load(w, &format!("{name}.kv"), dim, 2 * dim)?,
            out: Linear::load(w, &format!("{name}.out"), dim, dim)?,
        })
    }

    /// One frame [1, dim] and its music [1, dim].
    pub fn step(
        &self,
        x: &Tensor,
        music: &Tensor,
        ring: &Ring,
        slot: usize,
        bias: &Tensor,
    ) -> TensorResult<Tensor> {
        let kv = split_heads(&self.kv.forward(music)?, 2, self.heads)?;
        ring.write(slot, &kv[0], &kv[1])?;
        let q = split_heads(&self.q.forward(x)?, 1, self.heads)?;
        self.out
            .forward(&attend(&q[0], &ring.keys, &ring.values, bias)?)
    }

    /// All frames [n, dim] with all music [n, dim] at once.
    pub fn one_shot(&self, x: &Tensor, music: &Tensor, bias: &Tensor) -> TensorResult<Tensor> {
        let kv = split_heads(&self.kv.forward(music)?, 2, self.heads)?;
        let q = split_heads(&self.q.forward(x)?, 1, self.heads)?;
        self.out.forward(&attend(&q[0], &kv[0], &kv[1], bias)?)
    }
}
