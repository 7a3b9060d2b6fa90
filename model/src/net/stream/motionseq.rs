//! Stage 2, MotionSeq: the next code of every body part from the codes before,
//! the music up to now and a style.
//!
//! Frame i reads the codes of frame i-1 and the music of frame i. There is no
//! start token: the codes before the first frame are given, so that dances
//! chain. Music is normalised by the caller. A state has one or more lanes:
//! the same dance with other music (or none), for guidance; they read the
//! weights together.

use super::layer::{AttentionBlock, AttentionWork, FeedForward, Table, Work};
use crate::error::ModelError;
use crate::net::config::{ModelConfig, Positions};
use crate::net::engine::{
    After, Clock, Dtype, Engine, Heads, Input, Linear, Norm, Ring, Team, add_positions, gather,
    styled,
};
use crate::net::weights::Weights;

/// Self-attention, cross-attention on music, style, feed-forward.
#[derive(Clone, Debug)]
struct Layer {
    attention: AttentionBlock,
    cross: AttentionBlock,
    style: Linear,
    feed_forward: FeedForward,
}

/// A body part's output: parts after the first see the codes chosen before.
#[derive(Clone, Debug)]
struct PartHead {
    embed: Table,
    /// Tells later parts this part's code; none for the last.
    given: Option<Table>,
    refine: Option<FeedForward>,
    head: Linear,
}

impl PartHead {
    fn load(w: &Weights, index: usize, dtype: Dtype) -> Result<Self, ModelError> {
        let config = w.config();
        let (dim, codes, part) = (config.seq.dim, config.codes, &config.parts[index]);
        let given = (index + 1 < config.parts.len())
            .then(|| Table::load(w, &format!("seq.given.{part}.weight"), codes, dim))
            .transpose()?;
        let (norm, name) = (
            format!("seq.refine_norm.{part}"),
            format!("seq.refine.{part}"),
        );
        let refine = (index > 0)
            .then(|| FeedForward::load(w, (&norm, &name), dim, dim, dtype))
            .transpose()?;
        let classes = config.classes(index);
        Ok(Self {
            embed: Table::load(w, &format!("seq.embed.{part}.weight"), codes, dim)?,
            given,
            refine,
            head: Linear::load(w, &format!("seq.head.{part}"), dim, classes, dtype)?,
        })
    }

    fn bytes(&self) -> usize {
        self.refine.as_ref().map_or(0, FeedForward::bytes) + self.head.bytes()
    }
}

/// The weights of MotionSeq.
#[derive(Clone, Debug)]
pub struct MotionSeq {
    config: ModelConfig,
    dtype: Dtype,
    heads: Heads,
    cross_heads: Heads,
    music_in: Linear,
    music_null: Vec<f32>,
    /// Keys and values of the music for all layers.
    music_kv: Linear,
    styles: Table,
    layers: Vec<Layer>,
    norm: Norm,
    parts: Vec<PartHead>,
}

/// Where one dance stands, in every lane.
#[derive(Clone, Debug)]
pub struct SeqState {
    clock: Clock,
    /// Layer by layer, in each all lanes.
    own: Vec<Ring>,
    music: Vec<Ring>,
    /// The style's scale for every layer.
    style: Vec<f32>,
    heard: Input,
    stream: Input,
    keys_values: Vec<f32>,
    work: Work,
    room: AttentionWork,
    /// Lane by lane: what the heads read.
    hidden: Vec<f32>,
    head_work: Work,
    logits: Vec<f32>,
}

impl MotionSeq {
    /// Takes the tensors under `seq.` out of the file.
    pub fn load(w: &Weights, engine: &Engine) -> Result<Self, ModelError> {
        let (config, dtype) = (w.config().clone(), engine.dtype());
        let seq = &config.seq;
        let (width, dim) = (seq.width_of_head(), seq.dim);
        let heads = Heads::new(seq.used_slopes(), width, seq.window);
        let cross_heads = Heads::new(seq.used_cross_slopes(), width, seq.window);
        // Styles are read once a dance: no need to save there.
        let style_dtype = if dtype == Dtype::F32 {
            dtype
        } else {
            Dtype::F16
        };
        let layer = |i| {
            let name = format!("seq.layers.{i}");
            let names = (&*format!("{name}.norm3"), &*format!("{name}.ff"));
            let style = format!("{name}.style.scale");
            Ok(Layer {
                attention: AttentionBlock::own(w, &name, dim, &heads, dtype)?,
                cross: AttentionBlock::cross(w, &name, dim, &cross_heads, dtype)?,
                style: Linear::load(w, &style, seq.style_dim, dim, style_dtype)?,
                feed_forward: FeedForward::load(w, names, dim, seq.ff, dtype)?,
            })
        };
        let keys_values = |i| {
            let name = format!("seq.layers.{i}.cross.kv");
            Linear::load(w, &name, dim, 2 * cross_heads.wide(), dtype)
        };
        let keys_values = (0..seq.layers).map(keys_values).collect::<Result<_, _>>()?;
        let parts = (0..config.parts.len()).map(|i| PartHead::load(w, i, dtype));
        let mut seq = Self {
            music_in: Linear::load(w, "seq.music_in", config.music_dim, dim, dtype)?,
            music_null: w.floats("seq.music_null", &[dim])?,
            music_kv: Linear::stack(keys_values, dim, dtype),
            styles: Table::load(w, "seq.style.weight", seq.styles.len() + 1, seq.style_dim)?,
            layers: (0..seq.layers)
                .map(layer)
                .collect::<Result<_, ModelError>>()?,
            norm: Norm::load(w, "seq.norm", dim)?,
            parts: parts.collect::<Result<_, _>>()?,
            dtype,
            heads,
            cross_heads,
            config,
        };
        seq.gather();
        Ok(seq)
    }

    /// All matrices together, in the order of their use.
    fn gather(&mut self) {
        let layers = self.layers.iter_mut().flat_map(|layer| {
            let attention = layer.attention.matrices().into_iter();
            let others = layer.cross.matrices().into_iter();
            attention.chain(others.chain(layer.feed_forward.matrices()))
        });
        let parts = self.parts.iter_mut().flat_map(|part| {
            let refine = part.refine.iter_mut().flat_map(FeedForward::matrices);
            refine.chain([part.head.matrix()])
        });
        let music = [self.music_in.matrix(), self.music_kv.matrix()];
        gather(music.into_iter().chain(layers).chain(parts));
    }

    /// A dance before its first frame, of so many lanes, in the null style.
    pub fn start(&self, lanes: usize) -> SeqState {
        let (dtype, dim, layers) = (self.dtype, self.config.seq.dim, self.layers.len());
        let widest = (3 * self.heads.wide()).max(2 * self.cross_heads.wide());
        let rings = |heads| vec![Ring::new(heads, dtype); layers * lanes];
        let classes = self.parts.iter().map(|part| part.head.outputs());
        let classes = classes.max().unwrap_or(0);
        SeqState {
            clock: Clock::new(self.config.seq.window),
            own: rings(&self.heads),
            music: rings(&self.cross_heads),
            style: self.style_scales(&self.style(None)),
            heard: Input::new(self.config.music_dim, lanes, dtype),
            stream: Input::new(dim, lanes, dtype),
            keys_values: vec![0.0; self.music_kv.outputs() * lanes],
            work: Work::new(dim, widest, self.config.seq.ff, lanes, dtype),
            room: AttentionWork::new(&self.heads, lanes, dtype),
            hidden: vec![0.0; dim * lanes],
            head_work: Work::new(dim, classes, dim, lanes, dtype),
            logits: vec![0.0; classes * lanes],
        }
    }

    /// The first lane alone, with all that it remembers.
    pub fn first_lane(&self, state: &SeqState) -> SeqState {
        let first = |rings: &[Ring]| rings.iter().step_by(state.lanes()).cloned().collect();
        SeqState {
            clock: state.clock.clone(),
            own: first(&state.own),
            music: first(&state.music),
            style: state.style.clone(),
            ..self.start(1)
        }
    }

    /// The learned vector of a style, an index into the configuration's styles;
    /// none is the null style.
    pub fn style(&self, style: Option<usize>) -> Vec<f32> {
        let null = self.config.seq.styles.len();
        self.styles.row(style.unwrap_or(null).min(null)).to_vec()
    }

    /// Dances on in the style of a vector.
    pub fn restyle(&self, state: &mut SeqState, style: &[f32]) {
        state.style = self.style_scales(style);
    }

    /// The next frame, from the codes of the frame before it and the music of
    /// each lane (none: as if there were no music). Then ask for logits.
    pub fn step(
        &self,
        team: &Team,
        state: &mut SeqState,
        previous: &[usize],
        music: &[Option<&[f32]>],
    ) {
        debug_assert_eq!(music.len(), state.work.lanes);
        self.hear(team, state, music);
        self.take_codes(state, previous);
        let SeqState {
            clock,
            own,
            music,
            style,
            keys_values,
            work,
            room,
            ..
        } = state;
        let (lanes, dim) = (work.lanes, work.dim);
        let rings = own
            .chunks_exact_mut(lanes)
            .zip(music.chunks_exact_mut(lanes));
        let layers = self.layers.iter().zip(style.chunks_exact(dim));
        for (i, ((layer, style), (own, music))) in layers.zip(rings).enumerate() {
            let scene = (&self.heads, &*clock);
            layer.attention.step(team, scene, own, None, work, room);
            let scene = (&self.cross_heads, &*clock);
            let given = (&keys_values[..], i * 2 * self.cross_heads.wide());
            let cross = &layer.cross;
            cross.step(team, scene, music, Some(given), work, room);
            for x in work.x.chunks_exact_mut(dim) {
                styled(team.cpu(), x, style);
            }
            layer.feed_forward.step(team, work);
        }
        clock.advance();
        let hidden = state.hidden.chunks_exact_mut(dim);
        for (hidden, x) in hidden.zip(work.x.chunks_exact(dim)) {
            self.norm.one(team.cpu(), x, hidden);
        }
    }

    /// The music of all lanes, and its keys and values for all layers.
    fn hear(&self, team: &Team, state: &mut SeqState, music: &[Option<&[f32]>]) {
        let SeqState {
            heard,
            stream,
            keys_values,
            work,
            clock,
            ..
        } = state;
        for (lane, music) in music.iter().enumerate() {
            match music {
                Some(music) => heard.lane_mut(lane).copy_from_slice(music),
                None => heard.lane_mut(lane).fill(0.0),
            }
        }
        heard.ready(team.cpu());
        let nothing = After::Nothing;
        let products = self
            .music_in
            .forward(team, heard, &mut work.products, nothing);
        stream.take(team.cpu(), products);
        for (lane, music) in music.iter().enumerate() {
            let row = stream.lane_mut(lane);
            if music.is_none() {
                row.copy_from_slice(&self.music_null);
            }
            work.lane_mut(lane).copy_from_slice(row);
            if self.config.seq.positions == Positions::Sinusoidal {
                add_positions(row, clock.frame());
            }
        }
        stream.ready(team.cpu());
        self.music_kv.forward(team, stream, keys_values, nothing);
    }

    /// The codes of the frame before, into vectors that hold the music.
    fn take_codes(&self, state: &mut SeqState, previous: &[usize]) {
        let seq = &self.config.seq;
        for x in state.work.x.chunks_exact_mut(seq.dim) {
            if !seq.music_at_input {
                x.fill(0.0);
            }
            for (part, code) in self.parts.iter().zip(previous) {
                let row = part.embed.row(*code);
                x.iter_mut().zip(row).for_each(|(x, e)| *x += e);
            }
            if seq.positions == Positions::Sinusoidal {
                add_positions(x, state.clock.frame());
            }
        }
    }

    /// Logits of one part for the frame of the last step; `chosen` are the
    /// codes of the parts before it. One slice a lane.
    pub fn logits<'a>(
        &self,
        team: &Team,
        state: &'a mut SeqState,
        part: usize,
        chosen: &[usize],
    ) -> impl Iterator<Item = &'a [f32]> + use<'a> {
        let SeqState {
            hidden,
            head_work: work,
            logits,
            ..
        } = state;
        work.x.copy_from_slice(hidden);
        for (earlier, code) in self.parts[..part].iter().zip(chosen) {
            let Some(given) = &earlier.given else {
                continue;
            };
            for x in work.x.chunks_exact_mut(work.dim) {
                x.iter_mut()
                    .zip(given.row(*code))
                    .for_each(|(x, g)| *x += g);
            }
        }
        let part = &self.parts[part];
        if let Some(refine) = &part.refine {
            refine.step(team, work);
        }
        for (lane, x) in work.x.chunks_exact(work.dim).enumerate() {
            work.normed.lane_mut(lane).copy_from_slice(x);
        }
        work.normed.ready(team.cpu());
        let (lanes, classes) = (work.lanes, part.head.outputs());
        let nothing = After::Nothing;
        let products = part
            .head
            .forward(team, &work.normed, &mut work.products, nothing);
        for (lane, logits) in logits.chunks_exact_mut(classes).take(lanes).enumerate() {
            let of_lane = products[lane..].iter().step_by(lanes);
            logits
                .iter_mut()
                .zip(of_lane)
                .for_each(|(to, from)| *to = *from);
        }
        logits.chunks_exact(classes).take(lanes)
    }

    /// Bytes of keys and values that a step of so many lanes reads once the
    /// window is full.
    pub fn cache_bytes(&self, lanes: usize) -> usize {
        let bytes = |heads| Ring::new(heads, self.dtype).bytes();
        self.layers.len() * lanes * (bytes(&self.heads) + bytes(&self.cross_heads))
    }

    /// Bytes of weights that a step and its logits read.
    pub fn bytes(&self) -> usize {
        let layer = |l: &Layer| l.attention.bytes() + l.cross.bytes() + l.feed_forward.bytes();
        let layers: usize = self.layers.iter().map(layer).sum();
        let parts: usize = self.parts.iter().map(PartHead::bytes).sum();
        self.music_in.bytes() + self.music_kv.bytes() + layers + parts
    }

    fn style_scales(&self, style: &[f32]) -> Vec<f32> {
        let team = crate::net::engine::Pool::new(1);
        let dtype = if self.dtype == Dtype::F32 {
            Dtype::F32
        } else {
            Dtype::F16
        };
        let mut input = Input::new(style.len(), 1, dtype);
        input.lane_mut(0).copy_from_slice(style);
        let mut scales = vec![0.0; self.layers.len() * self.config.seq.dim];
        let rows = scales.chunks_exact_mut(self.config.seq.dim);
        for (layer, row) in self.layers.iter().zip(rows) {
            layer
                .style
                .forward(&team.team(), &input, row, After::Nothing);
        }
        scales
    }
}

impl SeqState {
    /// Forgets all frames, not the style.
    pub fn restart(&mut self) {
        self.clock.jump(0);
    }

    /// Stands at a frame as if all before had been processed (with zeros): to
    /// measure what a step takes there.
    pub fn jump(&mut self, frame: u64) {
        self.clock.jump(frame);
    }

    /// What the heads read in a lane, after a step.
    pub fn hidden(&self, lane: usize) -> &[f32] {
        let dim = self.work.dim;
        &self.hidden[lane * dim..][..dim]
    }

    /// How many lanes there are.
    pub fn lanes(&self) -> usize {
        self.work.lanes
    }
}
