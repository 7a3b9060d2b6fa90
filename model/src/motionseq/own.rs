//! MotionSeq on the own engine.

use super::embeddings::CodeEmbeddings;
use crate::config::SeqConfig;
use crate::engine::{
    After, AttentionBlock, AttentionKind, AttentionScratch, AttentionShape, BlockScratch,
    CachePosition, FeedForwardBlock, Input, KvCache, LayerNorm, PackedLinear, Team, copy_lane,
    styled,
};
use crate::error::ModelError;
use crate::weights::{Dtype, Weights, gather};

#[derive(Clone, Debug)]
struct OwnLayer {
    attention: AttentionBlock,
    cross: AttentionBlock,
    feed_forward: FeedForwardBlock,
}

#[derive(Clone, Debug)]
struct OwnHead {
    /// Of the parts' codes after the first, which see those chosen before.
    refine: Option<FeedForwardBlock>,
    head: PackedLinear,
}

impl OwnHead {
    fn load(w: &Weights, index: usize, dtype: Dtype) -> Result<Self, ModelError> {
        let config = w.config();
        let (dim, code) = (config.seq.dim, &config.code_names()[index]);
        let (norm, name) = (format!("seq.refine_norm.{code}"), format!("seq.refine.{code}"));
        let refine = (index > 0 && config.is_first_level(index))
            .then(|| FeedForwardBlock::load(w, (&norm, &name), dim, dim, dtype))
            .transpose()?;
        let name = format!("seq.head.{code}");
        Ok(Self { refine, head: PackedLinear::load(w, &name, dim, config.classes(index), dtype)? })
    }

    fn bytes(&self) -> usize {
        self.refine.as_ref().map_or(0, FeedForwardBlock::bytes) + self.head.bytes()
    }
}

#[derive(Clone, Debug)]
pub(super) struct OwnSeq {
    config: SeqConfig,
    music_dim: usize,
    dtype: Dtype,
    shape: AttentionShape,
    cross_shape: AttentionShape,
    music_in: PackedLinear,
    music_null: Vec<f32>,
    /// Keys and values of the music for all layers.
    music_kv: PackedLinear,
    layers: Vec<OwnLayer>,
    norm: LayerNorm,
    embeddings: CodeEmbeddings,
    heads: Vec<OwnHead>,
}

#[derive(Clone, Debug)]
pub(super) struct OwnSeqState {
    position: CachePosition,
    own: Vec<KvCache>,
    music: Vec<KvCache>,
    /// The style's scale for every layer, [lanes, layers * dim].
    pub style: Vec<f32>,
    heard: Input,
    stream: Input,
    keys_values: Vec<f32>,
    work: BlockScratch,
    scratch: AttentionScratch,
    hidden: Vec<f32>,
    head_work: BlockScratch,
    logits: Vec<f32>,
}

impl OwnSeq {
    pub fn load(w: &Weights, dtype: Dtype) -> Result<Self, ModelError> {
        let (config, seq) = (w.config(), &w.config().seq);
        let dim = seq.dim;
        let shape =
            |slopes| AttentionShape { slopes, width: seq.width_of_head(), window: seq.window };
        let (own, cross) = (shape(seq.used_slopes()), shape(seq.used_cross_slopes()));
        let layer = |i| {
            let name = format!("seq.layers.{i}");
            let names = (&*format!("{name}.norm3"), &*format!("{name}.ff"));
            let attention = |kind, shape| AttentionBlock::load(w, (&name, kind), dim, shape, dtype);
            Ok(OwnLayer {
                attention: attention(AttentionKind::Own, &own)?,
                cross: attention(AttentionKind::Cross, &cross)?,
                feed_forward: FeedForwardBlock::load(w, names, dim, seq.ff, dtype)?,
            })
        };
        let keys_values = |i| {
            let name = format!("seq.layers.{i}.cross.kv");
            PackedLinear::load(w, &name, dim, 2 * cross.wide(), dtype)
        };
        let keys_values = (0..seq.layers).map(keys_values).collect::<Result<_, _>>()?;
        let heads = (0..config.codes_a_frame()).map(|i| OwnHead::load(w, i, dtype));
        let mut network = Self {
            music_in: PackedLinear::load(w, "seq.music_in", config.music_dim, dim, dtype)?,
            music_null: w.floats("seq.music_null", &[dim])?,
            music_kv: PackedLinear::stack(keys_values, dim, dtype),
            layers: (0..seq.layers).map(layer).collect::<Result<_, ModelError>>()?,
            norm: LayerNorm::load(w, "seq.norm", dim)?,
            embeddings: CodeEmbeddings::load(w)?,
            heads: heads.collect::<Result<_, _>>()?,
            music_dim: config.music_dim,
            config: seq.clone(),
            dtype,
            shape: own,
            cross_shape: cross,
        };
        network.gather();
        Ok(network)
    }

    /// All matrices together, in the order of their use.
    fn gather(&mut self) {
        let layers = self.layers.iter_mut().flat_map(|layer| {
            let attention = layer.attention.matrices().into_iter();
            let others = layer.cross.matrices().into_iter();
            attention.chain(others.chain(layer.feed_forward.matrices()))
        });
        let heads = self.heads.iter_mut().flat_map(|head| {
            let refine = head.refine.iter_mut().flat_map(FeedForwardBlock::matrices);
            refine.chain([head.head.matrix()])
        });
        let music = [self.music_in.matrix(), self.music_kv.matrix()];
        gather(music.into_iter().chain(layers).chain(heads));
    }

    /// A dance before its first frame, of so many lanes; its style is to be set.
    pub fn start(&self, lanes: usize) -> OwnSeqState {
        let (dtype, dim, layers) = (self.dtype, self.config.dim, self.layers.len());
        let widest = (3 * self.shape.wide()).max(2 * self.cross_shape.wide());
        let caches = |shape| vec![KvCache::new(shape, dtype); layers * lanes];
        let classes = self.heads.iter().map(|head| head.head.outputs());
        let classes = classes.max().unwrap_or(0);
        OwnSeqState {
            position: CachePosition::new(self.config.window),
            own: caches(&self.shape),
            music: caches(&self.cross_shape),
            style: vec![0.0; lanes * layers * dim],
            heard: Input::new(self.music_dim, lanes, dtype),
            stream: Input::new(dim, lanes, dtype),
            keys_values: vec![0.0; self.music_kv.outputs() * lanes],
            work: BlockScratch::new(dim, widest, self.config.ff, lanes, dtype),
            scratch: AttentionScratch::new(&self.shape, lanes, dtype),
            hidden: vec![0.0; dim * lanes],
            head_work: BlockScratch::new(dim, classes, dim, lanes, dtype),
            logits: vec![0.0; classes * lanes],
        }
    }

    /// The first lane alone, with all that it remembers.
    pub fn first_lane(&self, state: &OwnSeqState) -> OwnSeqState {
        let first = |caches: &[KvCache]| caches.iter().step_by(state.lanes()).cloned().collect();
        OwnSeqState {
            position: state.position.clone(),
            own: first(&state.own),
            music: first(&state.music),
            style: state.style[..self.layers.len() * self.config.dim].to_vec(),
            ..self.start(1)
        }
    }

    pub fn step(
        &self,
        team: &Team,
        state: &mut OwnSeqState,
        previous: &[usize],
        music: &[Option<&[f32]>],
    ) {
        debug_assert_eq!(music.len(), state.work.lanes);
        self.hear(team, state, music);
        self.take_codes(state, previous);
        let OwnSeqState { position, own, music, style, keys_values, work, scratch, .. } = state;
        let (lanes, dim) = (work.lanes, work.dim);
        let caches = own.chunks_exact_mut(lanes).zip(music.chunks_exact_mut(lanes));
        for (i, (layer, (own, music))) in self.layers.iter().zip(caches).enumerate() {
            let at = (&self.shape, &*position);
            layer.attention.step(team, at, own, None, work, scratch);
            let at = (&self.cross_shape, &*position);
            let given = (&keys_values[..], i * 2 * self.cross_shape.wide());
            layer.cross.step(team, at, music, Some(given), work, scratch);
            let styles = style.chunks_exact(self.layers.len() * dim);
            for (x, style) in work.x.chunks_exact_mut(dim).zip(styles) {
                styled(team.cpu(), x, &style[i * dim..][..dim]);
            }
            layer.feed_forward.step(team, work);
        }
        position.advance();
        let hidden = state.hidden.chunks_exact_mut(dim);
        for (hidden, x) in hidden.zip(work.x.chunks_exact(dim)) {
            self.norm.one(team.cpu(), x, hidden);
        }
    }

    /// The music of all lanes, and its keys and values for all layers.
    fn hear(&self, team: &Team, state: &mut OwnSeqState, music: &[Option<&[f32]>]) {
        let OwnSeqState { heard, stream, keys_values, work, position, .. } = state;
        for (lane, music) in music.iter().enumerate() {
            match music {
                Some(music) => heard.lane_mut(lane).copy_from_slice(music),
                None => heard.lane_mut(lane).fill(0.0),
            }
        }
        heard.ready(team.cpu());
        let nothing = After::Nothing;
        let products = self.music_in.forward(team, heard, &mut work.products, nothing);
        stream.take(team.cpu(), products);
        for (lane, music) in music.iter().enumerate() {
            let row = stream.lane_mut(lane);
            if music.is_none() {
                row.copy_from_slice(&self.music_null);
            }
            work.lane_mut(lane).copy_from_slice(row);
            self.embeddings.add_position(row, position.frame());
        }
        stream.ready(team.cpu());
        self.music_kv.forward(team, stream, keys_values, nothing);
    }

    /// The codes of the frame before, into vectors that hold the music.
    fn take_codes(&self, state: &mut OwnSeqState, previous: &[usize]) {
        for x in state.work.x.chunks_exact_mut(self.config.dim) {
            if !self.config.music_at_input {
                x.fill(0.0);
            }
            self.embeddings.add_previous(x, previous);
            self.embeddings.add_position(x, state.position.frame());
        }
    }

    pub fn logits<'a>(
        &self,
        team: &Team,
        state: &'a mut OwnSeqState,
        index: usize,
        chosen: &[usize],
    ) -> &'a [f32] {
        let OwnSeqState { hidden, head_work: work, logits, .. } = state;
        work.x.copy_from_slice(hidden);
        for x in work.x.chunks_exact_mut(work.dim) {
            self.embeddings.add_chosen(x, &chosen[..index]);
        }
        let OwnHead { refine, head } = &self.heads[index];
        if let Some(refine) = refine {
            refine.step(team, work);
        }
        for (lane, x) in work.x.chunks_exact(work.dim).enumerate() {
            work.normed.lane_mut(lane).copy_from_slice(x);
        }
        work.normed.ready(team.cpu());
        let (lanes, classes) = (work.lanes, head.outputs());
        let products = &mut work.products;
        let products = head.forward(team, &work.normed, products, After::Nothing);
        let logits = &mut logits[..lanes * classes];
        for (lane, logits) in logits.chunks_exact_mut(classes).enumerate() {
            copy_lane(logits, products, lane, lanes);
        }
        logits
    }

    pub fn cache_bytes(&self, lanes: usize) -> usize {
        let bytes = |shape| KvCache::new(shape, self.dtype).bytes();
        self.layers.len() * lanes * (bytes(&self.shape) + bytes(&self.cross_shape))
    }

    pub fn bytes(&self) -> usize {
        let layer = |l: &OwnLayer| l.attention.bytes() + l.cross.bytes() + l.feed_forward.bytes();
        let layers: usize = self.layers.iter().map(layer).sum();
        let heads: usize = self.heads.iter().map(OwnHead::bytes).sum();
        self.music_in.bytes() + self.music_kv.bytes() + layers + heads
    }
}

impl OwnSeqState {
    pub fn jump(&mut self, frame: u64) {
        self.position.jump(frame);
    }

    pub fn hidden(&self) -> &[f32] {
        &self.hidden
    }

    pub fn lanes(&self) -> usize {
        self.work.lanes
    }
}
