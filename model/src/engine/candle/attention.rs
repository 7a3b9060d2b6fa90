//! Attention with a KV cache on candle's tensors.

use candle_core::{DType, Device, Result as TensorResult, Tensor};
use candle_nn::ops;

use super::AttentionWindow;
use super::{TensorLinear, TensorNorm, TensorSource};
use crate::error::ModelError;
use crate::weights::Dtype;

/// KV cache: keys and values of the frames that the next one sees; the oldest
/// frame leaves as the newest comes.
#[derive(Clone, Debug)]
pub(crate) struct TensorCache {
    lanes: usize,
    heads: usize,
    width: usize,
    /// Frames that are kept: all that a frame sees but itself.
    kept: usize,
    /// Whether numbers are rounded to f16, as in the own engine's cache.
    half: bool,
    /// Each [lanes, heads, frames, width]; none before the first frame.
    past: Option<[Tensor; 2]>,
}

impl TensorCache {
    pub fn new(
        attention: &TensorAttention,
        lanes: usize,
        window: AttentionWindow,
        dtype: Dtype,
    ) -> Self {
        let causal = window.ahead == 0;
        Self {
            lanes,
            heads: attention.heads,
            width: attention.width,
            kept: if causal { window.frames - 1 } else { 0 },
            half: dtype != Dtype::F32,
            past: None,
        }
    }

    pub fn frames(&self) -> usize {
        self.past.as_ref().map_or(0, |[keys, _]| keys.dims()[2])
    }

    /// Bytes that a step reads once the window is full, as f32.
    pub fn bytes(&self) -> usize {
        2 * 4 * self.lanes * self.heads * (self.kept + 1) * self.width
    }

    /// Stands as if so many frames had been processed, with zeros.
    pub fn jump(&mut self, frames: u64) {
        let held = frames.min(self.kept as u64) as usize;
        let shape = (self.lanes, self.heads, held, self.width);
        let zeros = Tensor::zeros(shape, DType::F32, &Device::Cpu).ok();
        self.past = zeros.filter(|_| held > 0).map(|z| [z.clone(), z]);
    }

    /// The first lane alone, with all that it holds.
    pub fn first_lane(&self) -> TensorResult<Self> {
        let first = |held: &Tensor| held.narrow(0, 0, 1)?.contiguous();
        let past = match &self.past {
            Some([keys, values]) => Some([first(keys)?, first(values)?]),
            None => None,
        };
        Ok(Self { lanes: 1, past, ..*self })
    }

    /// Keys and values of the frames held and of new ones; keeps the last of them.
    fn rotate(&mut self, new: [Tensor; 2]) -> TensorResult<[Tensor; 2]> {
        let [mut keys, mut values] = new;
        if self.half {
            keys = keys.to_dtype(DType::F16)?.to_dtype(DType::F32)?;
            values = values.to_dtype(DType::F16)?.to_dtype(DType::F32)?;
        }
        if let Some([old_keys, old_values]) = &self.past {
            keys = Tensor::cat(&[old_keys, &keys], 2)?;
            values = Tensor::cat(&[old_values, &values], 2)?;
        }
        let all = keys.dim(2)?;
        let held = all.min(self.kept);
        let last = |of: &Tensor| of.narrow(2, all - held, held)?.contiguous();
        self.past = match held {
            0 => None,
            _ => Some([last(&keys)?, last(&values)?]),
        };
        Ok([keys, values])
    }
}

/// Layer norm and attention, added to what comes in.
#[derive(Clone, Debug)]
pub(crate) struct TensorAttention {
    heads: usize,
    width: usize,
    norm: TensorNorm,
    /// To queries; in self-attention to keys and values as well.
    project: TensorLinear,
    /// Of cross-attention: the music to keys and values.
    keys_values: Option<TensorLinear>,
    out: TensorLinear,
}

impl TensorAttention {
    /// Self-attention or, if so, `cross`-attention of the layer `name`; heads and
    /// the width of each.
    pub fn load(
        w: &impl TensorSource,
        (name, cross): (&str, bool),
        dim: usize,
        (heads, width): (usize, usize),
    ) -> Result<Self, ModelError> {
        let wide = heads * width;
        let linear = |name: String, input, output| TensorLinear::load(w, &name, input, output);
        Ok(match cross {
            false => Self {
                heads,
                width,
                norm: TensorNorm::load(w, &format!("{name}.norm1"), dim)?,
                project: linear(format!("{name}.attn.qkv"), dim, 3 * wide)?,
                keys_values: None,
                out: linear(format!("{name}.attn.out"), wide, dim)?,
            },
            true => Self {
                heads,
                width,
                norm: TensorNorm::load(w, &format!("{name}.norm2"), dim)?,
                project: linear(format!("{name}.cross.q"), dim, wide)?,
                keys_values: Some(linear(format!("{name}.cross.kv"), dim, 2 * wide)?),
                out: linear(format!("{name}.cross.out"), wide, dim)?,
            },
        })
    }

    pub fn bytes(&self) -> usize {
        let music = self.keys_values.as_ref().map_or(0, TensorLinear::bytes);
        self.project.bytes() + music + self.out.bytes()
    }

    /// The next frames of all lanes, rows [lanes * frames, dim]; `music` are as
    /// many rows for cross-attention. `bias` is [heads, frames, keys].
    pub fn forward(
        &self,
        x: &Tensor,
        music: Option<&Tensor>,
        bias: &Tensor,
        cache: &mut TensorCache,
    ) -> TensorResult<Tensor> {
        let lanes = cache.lanes;
        let projected = self.project.forward(&self.norm.forward(x)?)?;
        let (queries, keys, values) = match (&self.keys_values, music) {
            (Some(keys_values), Some(music)) => {
                let given = keys_values.forward(music)?;
                let part = |p| self.split_heads(&given, p, lanes);
                (self.split_heads(&projected, 0, lanes)?, part(0)?, part(1)?)
            }
            _ => {
                let part = |p| self.split_heads(&projected, p, lanes);
                (part(0)?, part(1)?, part(2)?)
            }
        };
        let [keys, values] = cache.rotate([keys, values])?;
        let queries = (queries * (self.width as f64).powf(-0.5))?;
        let scores = queries.matmul(&keys.t()?)?.broadcast_add(bias)?;
        let mixed = ops::softmax_last_dim(&scores)?.matmul(&values)?;
        let rows = mixed.transpose(1, 2)?.reshape((x.dim(0)?, ()))?;
        x + self.out.forward(&rows)?
    }

    /// The `part`th block of heads of rows, as [lanes, heads, frames, width].
    fn split_heads(&self, rows: &Tensor, part: usize, lanes: usize) -> TensorResult<Tensor> {
        let wide = self.heads * self.width;
        let frames = rows.dim(0)? / lanes;
        rows.narrow(1, part * wide, wide)?
            .reshape((lanes, frames, self.heads, self.width))?
            .transpose(1, 2)?
            .contiguous()
    }
}
