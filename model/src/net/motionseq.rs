//! Stage 2 in candle, all frames at once: the check of the one that streams
//! ([`super::MotionSeq`], where the network is explained), and the way to score
//! sequences that are known. `lookahead` counts here.

use candle_core::{D, Device, Result as TensorResult, Tensor};

use super::attention::{CrossAttention, SelfAttention, one_shot_bias};
use super::config::{Positions, SeqConfig};
use super::decoder::column;
use super::engine::add_positions;
use super::layers::{FeedForward, Linear, Norm};
use super::weights::Weights;
use crate::error::ModelError;

/// Self-attention, cross-attention on music, style, feed-forward; pre-norm.
#[derive(Clone, Debug)]
struct Layer {
    norm1: Norm,
    attention: SelfAttention,
    norm2: Norm,
    cross: CrossAttention,
    style: Linear,
    norm3: Norm,
    feed_forward: FeedForward,
}

impl Layer {
    fn load(w: &Weights, name: &str, seq: &SeqConfig) -> Result<Self, ModelError> {
        let dim = seq.dim;
        let heads = (seq.heads, seq.width_of_head());
        Ok(Self {
            norm1: Norm::load(w, &format!("{name}.norm1"), dim)?,
            attention: SelfAttention::load(w, &format!("{name}.attn"), dim, heads)?,
            norm2: Norm::load(w, &format!("{name}.norm2"), dim)?,
            cross: CrossAttention::load(w, &format!("{name}.cross"), dim, heads)?,
            style: Linear::load(w, &format!("{name}.style.scale"), seq.style_dim, dim)?,
            norm3: Norm::load(w, &format!("{name}.norm3"), dim)?,
            feed_forward: FeedForward::load(w, &format!("{name}.ff"), dim, seq.ff)?,
        })
    }
}

/// A body part's output: parts after the first see the codes chosen before.
#[derive(Clone, Debug)]
struct PartHead {
    embed: Tensor,
    /// Table that tells later parts this part's code; none for the last.
    given: Option<Tensor>,
    refine: Option<(Norm, FeedForward)>,
    head: Linear,
}

impl PartHead {
    fn load(w: &Weights, index: usize) -> Result<Self, ModelError> {
        let config = w.config();
        let (dim, codes, part) = (config.seq.dim, config.codes, &config.parts[index]);
        let given = (index + 1 < config.parts.len())
            .then(|| w.tensor(&format!("seq.given.{part}.weight"), &[codes, dim]))
            .transpose()?;
        let refine = if index > 0 {
            let norm = Norm::load(w, &format!("seq.refine_norm.{part}"), dim)?;
            let name = format!("seq.refine.{part}");
            Some((norm, FeedForward::load(w, &name, dim, dim)?))
        } else {
            None
        };
        Ok(Self {
            embed: w.tensor(&format!("seq.embed.{part}.weight"), &[codes, dim])?,
            given,
            refine,
            head: Linear::load(w, &format!("seq.head.{part}"), dim, config.classes(index))?,
        })
    }
}

/// The weights of MotionSeq, as tensors.
#[derive(Clone, Debug)]
pub struct OneShotSeq {
    config: SeqConfig,
    music_dim: usize,
    music_in: Linear,
    music_null: Tensor,
    styles: Tensor,
    layers: Vec<Layer>,
    norm: Norm,
    parts: Vec<PartHead>,
}

impl OneShotSeq {
    /// Takes the tensors under `seq.` out of the file.
    pub fn load(w: &Weights) -> Result<Self, ModelError> {
        let config = w.config();
        let seq = config.seq.clone();
        let layers = (0..seq.layers).map(|i| Layer::load(w, &format!("seq.layers.{i}"), &seq));
        let parts = (0..config.parts.len()).map(|i| PartHead::load(w, i));
        Ok(Self {
            music_dim: config.music_dim,
            music_in: Linear::load(w, "seq.music_in", config.music_dim, seq.dim)?,
            music_null: w.tensor("seq.music_null", &[seq.dim])?.unsqueeze(0)?,
            styles: w.tensor("seq.style.weight", &[seq.styles.len() + 1, seq.style_dim])?,
            layers: layers.collect::<Result<_, _>>()?,
            norm: Norm::load(w, "seq.norm", seq.dim)?,
            parts: parts.collect::<Result<_, _>>()?,
            config: seq,
        })
    }

    /// Hidden vectors [frames, dim] of all frames at once; `music` holds
    /// frames times 39 numbers, or none.
    pub fn one_shot(
        &self,
        previous: &[Vec<usize>],
        music: Option<&[f32]>,
        style: Option<usize>,
    ) -> Result<Tensor, ModelError> {
        let (seq, length) = (&self.config, previous.len());
        let stream = self.music_stream(music, length)?;
        let mut x = self.input(previous, &stream)?;
        let mut stream = stream;
        if seq.positions == Positions::Sinusoidal {
            let positions = positions(length, seq.dim)?;
            x = (x + &positions)?;
            stream = (stream + positions)?;
        }
        let bias = one_shot_bias(length, &seq.used_slopes(), seq.window, 0)?;
        let cross_bias = match seq.cross_aligned {
            true => {
                let slopes = seq.used_cross_slopes();
                one_shot_bias(length, &slopes, seq.window, seq.lookahead)?
            }
            false => Tensor::zeros((seq.heads, length, length), x.dtype(), &Device::Cpu)?,
        };
        let scales = self.style_scales(style)?;
        for (layer, scale) in self.layers.iter().zip(&scales) {
            x = (&x + layer.attention.one_shot(&layer.norm1.forward(&x)?, &bias)?)?;
            let query = layer.norm2.forward(&x)?;
            let heard = layer.cross.one_shot(&query, &stream, &cross_bias)?;
            x = styled(&(&x + heard)?, scale)?;
            x = (&x + layer.feed_forward.forward(&layer.norm3.forward(&x)?)?)?;
        }
        Ok(self.norm.forward(&x)?)
    }

    /// Logits [frames, codes] of one part; `chosen` holds, for every frame,
    /// at least the codes of the parts before it.
    pub fn logits(
        &self,
        part: usize,
        hidden: &Tensor,
        chosen: &[Vec<usize>],
    ) -> Result<Tensor, ModelError> {
        let mut hidden = hidden.clone();
        for (earlier, head) in self.parts[..part].iter().enumerate() {
            if let Some(table) = &head.given {
                hidden = (hidden + table.index_select(&column(chosen, earlier)?, 0)?)?;
            }
        }
        let head = &self.parts[part];
        if let Some((norm, feed_forward)) = &head.refine {
            hidden = (&hidden + feed_forward.forward(&norm.forward(&hidden)?)?)?;
        }
        Ok(head.head.forward(&hidden)?)
    }

    fn input(&self, previous: &[Vec<usize>], stream: &Tensor) -> TensorResult<Tensor> {
        let mut x = None;
        for (i, part) in self.parts.iter().enumerate() {
            let rows = part.embed.index_select(&column(previous, i)?, 0)?;
            x = Some(match x {
                Some(sum) => (sum + rows)?,
                None => rows,
            });
        }
        match x {
            Some(x) if self.config.music_at_input => x + stream,
            Some(x) => Ok(x),
            None => Ok(stream.clone()),
        }
    }

    fn music_stream(&self, music: Option<&[f32]>, frames: usize) -> TensorResult<Tensor> {
        let Some(music) = music else {
            let dim = self.config.dim;
            return self.music_null.broadcast_as((frames, dim))?.contiguous();
        };
        let rows = Tensor::from_slice(music, (frames, self.music_dim), &Device::Cpu)?;
        self.music_in.forward(&rows)
    }

    fn style_scales(&self, style: Option<usize>) -> TensorResult<Vec<Tensor>> {
        let null = self.config.styles.len();
        self.scales_of(&self.styles.narrow(0, style.unwrap_or(null).min(null), 1)?)
    }

    fn scales_of(&self, row: &Tensor) -> TensorResult<Vec<Tensor>> {
        self.layers
            .iter()
            .map(|layer| layer.style.forward(row))
            .collect()
    }
}

/// Absolute positions [frames, dim].
fn positions(frames: usize, dim: usize) -> TensorResult<Tensor> {
    let mut rows = vec![0.0; frames * dim];
    for (frame, row) in rows.chunks_exact_mut(dim).enumerate() {
        add_positions(row, frame as u64);
    }
    Tensor::from_vec(rows, (frames, dim), &Device::Cpu)
}

/// Eq. 5 as a residual branch: `x + scale * x / |x| * sqrt(dim)`.
fn styled(x: &Tensor, scale: &Tensor) -> TensorResult<Tensor> {
    let dim = x.dim(D::Minus1)? as f64;
    let length = (x.sqr()?.sum_keepdim(D::Minus1)? + 1e-6)?.sqrt()?;
    let unit = (x.broadcast_div(&length)? * dim.sqrt())?;
    x + unit.broadcast_mul(scale)?
}
