//! MotionSeq on the candle engine: one frame of a dance, or many frames that are
//! known.

use candle_core::{D, Device, Result as TensorResult, Tensor};

use super::embeddings::CodeEmbeddings;
use crate::config::SeqConfig;
use crate::engine::candle::{
    RoundedWeights, TensorAttention, TensorCache, TensorFeedForward, TensorLinear, TensorNorm,
};
use crate::engine::{AttentionWindow, attention_bias};
use crate::error::ModelError;
use crate::weights::{Dtype, Weights};

#[derive(Clone, Debug)]
struct CandleLayer {
    attention: TensorAttention,
    cross: TensorAttention,
    feed_forward: TensorFeedForward,
}

#[derive(Clone, Debug)]
struct CandleHead {
    /// Of the parts' codes after the first, which see those chosen before.
    refine: Option<TensorFeedForward>,
    head: TensorLinear,
}

impl CandleHead {
    fn load(w: &Weights, index: usize, dtype: Dtype) -> Result<Self, ModelError> {
        let (config, rounded) = (w.config(), RoundedWeights(w, dtype));
        let (dim, code) = (config.seq.dim, &config.code_names()[index]);
        let (norm, name) = (format!("seq.refine_norm.{code}"), format!("seq.refine.{code}"));
        let load =
            || TensorFeedForward::load(&rounded, (&norm, &name), (dim, dim), config.activation);
        let head = format!("seq.head.{code}");
        Ok(Self {
            refine: (index > 0 && config.is_first_level(index)).then(load).transpose()?,
            head: TensorLinear::load(&rounded, &head, dim, config.classes(index))?,
        })
    }
}

#[derive(Clone, Debug)]
pub(crate) struct CandleSeq {
    config: SeqConfig,
    music_dim: usize,
    dtype: Dtype,
    music_in: TensorLinear,
    music_null: Tensor,
    layers: Vec<CandleLayer>,
    norm: TensorNorm,
    embeddings: CodeEmbeddings,
    heads: Vec<CandleHead>,
}

#[derive(Clone, Debug)]
pub(crate) struct CandleSeqState {
    lanes: usize,
    frame: u64,
    own: Vec<TensorCache>,
    music: Vec<TensorCache>,
    /// The style's scale for every layer, [lanes, layers * dim].
    pub style: Vec<f32>,
    /// What the heads read, [lanes * frames, dim].
    hidden: Vec<f32>,
    logits: Vec<f32>,
}

impl CandleSeq {
    pub fn load(w: &Weights, dtype: Dtype) -> Result<Self, ModelError> {
        let (config, seq) = (w.config(), &w.config().seq);
        let (rounded, dim) = (RoundedWeights(w, dtype), seq.dim);
        let heads = (seq.heads, seq.width_of_head());
        let layer = |i| {
            let name = format!("seq.layers.{i}");
            let names = (&*format!("{name}.norm3"), &*format!("{name}.ff"));
            let attention = |cross| TensorAttention::load(&rounded, (&name, cross), dim, heads);
            let sizes = (dim, seq.ff);
            Ok(CandleLayer {
                attention: attention(false)?,
                cross: attention(true)?,
                feed_forward: TensorFeedForward::load(&rounded, names, sizes, config.activation)?,
            })
        };
        let heads = (0..config.codes_a_frame()).map(|i| CandleHead::load(w, i, dtype));
        Ok(Self {
            music_dim: config.music_dim,
            music_in: TensorLinear::load(&rounded, "seq.music_in", config.music_dim, dim)?,
            music_null: w.tensor("seq.music_null", &[dim])?.unsqueeze(0)?,
            layers: (0..seq.layers).map(layer).collect::<Result<_, ModelError>>()?,
            norm: TensorNorm::load(&rounded, "seq.norm", dim)?,
            embeddings: CodeEmbeddings::load(w)?,
            heads: heads.collect::<Result<_, _>>()?,
            config: seq.clone(),
            dtype,
        })
    }

    /// A dance before its first frame, of so many lanes; its style is to be set.
    pub fn start(&self, lanes: usize) -> CandleSeqState {
        let cache = |attention| TensorCache::new(attention, lanes, self.window(), self.dtype);
        let layers = self.layers.iter();
        CandleSeqState {
            lanes,
            frame: 0,
            own: layers.clone().map(|l| cache(&l.attention)).collect(),
            music: layers.map(|l| cache(&l.cross)).collect(),
            style: vec![0.0; lanes * self.layers.len() * self.config.dim],
            hidden: Vec::new(),
            logits: Vec::new(),
        }
    }

    fn window(&self) -> AttentionWindow {
        AttentionWindow { frames: self.config.window, ahead: 0 }
    }

    /// The next frames: `previous` holds a row of codes for each, `music` the
    /// frames of each lane one after another.
    pub fn frames(
        &self,
        state: &mut CandleSeqState,
        previous: &[&[usize]],
        music: &[Option<&[f32]>],
    ) -> Result<(), ModelError> {
        let (seq, count) = (&self.config, previous.len());
        let held = state.own.first().map_or(0, TensorCache::frames);
        let bias = |slopes: &[f32]| attention_bias(slopes, count, held + count, self.window());
        let (own_bias, cross_bias) = (bias(&seq.used_slopes())?, bias(&seq.used_cross_slopes())?);
        let lanes = music.iter().map(|music| self.music_rows(*music, count));
        let lanes: Vec<Tensor> = lanes.collect::<TensorResult<_>>()?;
        let mut stream = Tensor::cat(&lanes, 0)?;
        let mut x = self.code_rows(state, previous)?;
        if seq.music_at_input {
            x = (x + &stream)?;
        }
        let positions = self.position_rows(state, count)?;
        x = (x + &positions)?;
        stream = (stream + positions)?;
        let styles = (0..self.layers.len()).map(|layer| self.style_rows(state, count, layer));
        let styles: Vec<Tensor> = styles.collect::<TensorResult<_>>()?;
        let caches = state.own.iter_mut().zip(&mut state.music);
        for ((layer, style), (own, heard)) in self.layers.iter().zip(&styles).zip(caches) {
            x = layer.attention.forward(&x, None, &own_bias, own)?;
            x = layer.cross.forward(&x, Some(&stream), &cross_bias, heard)?;
            x = styled(&x, style)?;
            x = layer.feed_forward.forward(&x)?;
        }
        state.frame += count as u64;
        state.hidden = self.norm.forward(&x)?.flatten_all()?.to_vec1()?;
        Ok(())
    }

    /// Logits of one code, [lanes * frames, classes], for the frames of the last
    /// step; `chosen` holds, for each frame, at least the codes before it.
    pub fn logits<'a>(
        &self,
        state: &'a mut CandleSeqState,
        index: usize,
        chosen: &[&[usize]],
    ) -> Result<&'a [f32], ModelError> {
        let dim = self.config.dim;
        let mut hidden = state.hidden.clone();
        for (row, chosen) in hidden.chunks_exact_mut(dim).zip(chosen.iter().cycle()) {
            self.embeddings.add_chosen(row, &chosen[..index]);
        }
        let rows = hidden.len() / dim;
        let mut x = Tensor::from_vec(hidden, (rows, dim), &Device::Cpu)?;
        let CandleHead { refine, head } = &self.heads[index];
        if let Some(refine) = refine {
            x = refine.forward(&x)?;
        }
        state.logits = head.forward(&x)?.flatten_all()?.to_vec1()?;
        Ok(&state.logits)
    }

    /// The music of one lane, [frames, dim]; without music the null vector.
    fn music_rows(&self, music: Option<&[f32]>, frames: usize) -> TensorResult<Tensor> {
        match music {
            None => {
                let shape = (frames, self.config.dim);
                self.music_null.broadcast_as(shape)?.contiguous()
            }
            Some(music) => {
                let rows = Tensor::from_slice(music, (frames, self.music_dim), &Device::Cpu)?;
                self.music_in.forward(&rows)
            }
        }
    }

    /// The codes of the frames before, in all lanes, [lanes * frames, dim].
    fn code_rows(&self, state: &CandleSeqState, previous: &[&[usize]]) -> TensorResult<Tensor> {
        self.rows(state, previous.len(), |row, frame| {
            self.embeddings.add_previous(row, previous[frame]);
        })
    }

    /// Where the frames stand, all zeros with ALiBi.
    fn position_rows(&self, state: &CandleSeqState, frames: usize) -> TensorResult<Tensor> {
        self.rows(state, frames, |row, frame| {
            self.embeddings.add_position(row, state.frame + frame as u64);
        })
    }

    /// The scales of one layer by the style of each lane.
    fn style_rows(
        &self,
        state: &CandleSeqState,
        frames: usize,
        layer: usize,
    ) -> TensorResult<Tensor> {
        let (dim, layers) = (self.config.dim, self.layers.len());
        let of_lane = |lane: usize| &state.style[(lane * layers + layer) * dim..][..dim];
        let rows = (0..state.lanes * frames).flat_map(|row| of_lane(row / frames));
        let rows: Vec<f32> = rows.copied().collect();
        Tensor::from_vec(rows, (state.lanes * frames, dim), &Device::Cpu)
    }

    fn rows(
        &self,
        state: &CandleSeqState,
        frames: usize,
        fill: impl Fn(&mut [f32], usize),
    ) -> TensorResult<Tensor> {
        let (dim, count) = (self.config.dim, state.lanes * frames);
        let mut rows = vec![0.0; count * dim];
        for (i, row) in rows.chunks_exact_mut(dim).enumerate() {
            fill(row, i % frames);
        }
        Tensor::from_vec(rows, (count, dim), &Device::Cpu)
    }

    pub fn cache_bytes(&self, lanes: usize) -> usize {
        let state = self.start(lanes);
        let caches = state.own.iter().chain(&state.music);
        caches.map(TensorCache::bytes).sum()
    }

    pub fn bytes(&self) -> usize {
        let layer =
            |l: &CandleLayer| l.attention.bytes() + l.cross.bytes() + l.feed_forward.bytes();
        let layers: usize = self.layers.iter().map(layer).sum();
        let refine = |head: &CandleHead| head.refine.as_ref().map_or(0, TensorFeedForward::bytes);
        let heads = self.heads.iter().map(|head| refine(head) + head.head.bytes());
        self.music_in.bytes() + layers + heads.sum::<usize>()
    }
}

impl CandleSeqState {
    pub fn jump(&mut self, frame: u64) {
        let caches = self.own.iter_mut().chain(&mut self.music);
        caches.for_each(|cache| cache.jump(frame));
        self.frame = frame;
    }

    pub fn first_lane(&self) -> TensorResult<Self> {
        let first = |caches: &[TensorCache]| {
            let first = caches.iter().map(TensorCache::first_lane);
            first.collect::<TensorResult<_>>()
        };
        let style = self.style[..self.style.len() / self.lanes].to_vec();
        Ok(Self {
            lanes: 1,
            own: first(&self.own)?,
            music: first(&self.music)?,
            style,
            ..self.clone()
        })
    }

    pub fn hidden(&self) -> &[f32] {
        &self.hidden
    }

    pub fn lanes(&self) -> usize {
        self.lanes
    }
}

/// Eq. 5 as a residual branch: `x + scale * x / |x| * sqrt(dim)`.
fn styled(x: &Tensor, scale: &Tensor) -> TensorResult<Tensor> {
    let dim = x.dim(D::Minus1)? as f64;
    let length = (x.sqr()?.sum_keepdim(D::Minus1)? + 1e-6)?.sqrt()?;
    let unit = (x.broadcast_div(&length)? * dim.sqrt())?;
    x + (unit * scale)?
}
