//! Stage 2, MotionSeq: the next code of every body part from the codes before,
//! the music up to now and a style.
//!
//! Frame i reads the codes of frame i-1 and the music of frame i. There is no
//! start token: the codes before the first frame are given, so that dances
//! chain. Music is normalised by the caller.

use candle_core::{D, Device, Result as TensorResult, Tensor};

use super::attention::{CrossAttention, Ring, RingClock, SelfAttention, one_shot_bias};
use super::config::SeqConfig;
use super::decoder::column;
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
        let (dim, heads) = (seq.dim, seq.heads);
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
            head: Linear::load(w, &format!("seq.head.{part}"), dim, codes)?,
        })
    }
}

/// The weights of MotionSeq.
#[derive(Clone, Debug)]
pub struct MotionSeq {
    config: SeqConfig,
    music_dim: usize,
    music_in: Linear,
    music_null: Tensor,
    styles: Tensor,
    layers: Vec<Layer>,
    norm: Norm,
    parts: Vec<PartHead>,
}

/// Where one dance stands: rotating caches and the style; constant memory.
#[derive(Debug)]
pub struct SeqState {
    clock: RingClock,
    own: Vec<Ring>,
    music: Vec<Ring>,
    /// The style's scale for every layer, [1, dim].
    style: Vec<Tensor>,
}

impl MotionSeq {
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

    /// A dance before its first frame; `style` indexes the configuration's
    /// styles, none is the null style.
    pub fn start(&self, style: Option<usize>) -> Result<SeqState, ModelError> {
        self.start_with(self.style_scales(style)?)
    }

    /// The same in a style that is not in the table but a vector of
    /// `style_dim` numbers.
    pub fn start_in_style(&self, style: &[f32]) -> Result<SeqState, ModelError> {
        let row = Tensor::from_slice(style, (1, self.config.style_dim), &Device::Cpu)?;
        self.start_with(self.scales_of(&row)?)
    }

    fn start_with(&self, style: Vec<Tensor>) -> Result<SeqState, ModelError> {
        let seq = &self.config;
        let ring = |_| Ring::new(seq.heads, seq.window, seq.dim);
        Ok(SeqState {
            clock: RingClock::new(seq.window),
            own: (0..seq.layers).map(ring).collect::<TensorResult<_>>()?,
            music: (0..seq.layers).map(ring).collect::<TensorResult<_>>()?,
            style,
        })
    }

    /// The hidden vector [1, dim] of the next frame, from the codes of the
    /// frame before it and its music (none: as if there were no music).
    pub fn step(
        &self,
        state: &mut SeqState,
        previous: &[usize],
        music: Option<&[f32]>,
    ) -> Result<Tensor, ModelError> {
        let seq = &self.config;
        let stream = self.music_stream(music, 1)?;
        let mut x = self.input(&[previous.to_vec()], &stream)?;
        let slot = state.clock.slot();
        let bias = state.clock.bias(&seq.slopes)?;
        let cross_bias = match seq.cross_aligned {
            true => state.clock.bias(&seq.cross_slopes)?,
            false => state.clock.bias(&vec![0.0; seq.heads])?,
        };
        for (i, layer) in self.layers.iter().enumerate() {
            let own = layer.norm1.forward(&x)?;
            x = (&x + layer.attention.step(&own, &state.own[i], slot, &bias)?)?;
            let query = layer.norm2.forward(&x)?;
            let heard = layer
                .cross
                .step(&query, &stream, &state.music[i], slot, &cross_bias)?;
            x = styled(&(&x + heard)?, &state.style[i])?;
            x = (&x + layer.feed_forward.forward(&layer.norm3.forward(&x)?)?)?;
        }
        state.clock.advance();
        Ok(self.norm.forward(&x)?)
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
        let bias = one_shot_bias(length, &seq.slopes, seq.window, 0)?;
        let cross_bias = match seq.cross_aligned {
            true => one_shot_bias(length, &seq.cross_slopes, seq.window, seq.lookahead)?,
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

/// Eq. 5 as a residual branch: `x + scale * x / |x| * sqrt(dim)`.
fn styled(x: &Tensor, scale: &Tensor) -> TensorResult<Tensor> {
    let dim = x.dim(D::Minus1)? as f64;
    let length = (x.sqr()?.sum_keepdim(D::Minus1)? + 1e-6)?.sqrt()?;
    let unit = (x.broadcast_div(&length)? * dim.sqrt())?;
    x + unit.broadcast_mul(scale)?
}
