//! Stage 1's causal decoder: the codes of a frame to its 137 numbers
//! (normalised).

use super::layer::{AttentionBlock, AttentionWork, FeedForward, Table, Work};
use crate::error::ModelError;
use crate::net::engine::{
    After, Clock, Dtype, Engine, Heads, Input, Linear, Norm, Ring, Team, gather,
};
use crate::net::weights::Weights;

/// The decoder's weights.
#[derive(Clone, Debug)]
pub struct VqDecoder {
    dtype: Dtype,
    heads: Heads,
    dim: usize,
    ff: usize,
    /// One table per body part.
    codebooks: Vec<Table>,
    code_dim: usize,
    input: Linear,
    layers: Vec<(AttentionBlock, FeedForward)>,
    norm: Norm,
    output: Linear,
}

/// Where one stream of frames stands.
#[derive(Clone, Debug)]
pub struct DecoderState {
    clock: Clock,
    rings: Vec<Ring>,
    codes: Input,
    work: Work,
    room: AttentionWork,
}

impl VqDecoder {
    /// Takes the tensors under `vq.` out of the file.
    pub fn load(w: &Weights, engine: &Engine) -> Result<Self, ModelError> {
        let (config, dtype) = (w.config(), engine.dtype());
        let vq = &config.vq;
        let slopes = vq.decoder_slopes.clone();
        let heads = Heads::new(slopes, vq.decoder_head_dim(), vq.decoder_window);
        let codebook = |part| {
            let name = format!("vq.codebook.{part}");
            Table::load(w, &name, config.codes, config.code_dim)
        };
        let layer = |i| {
            let name = format!("vq.decoder.layers.{i}");
            let attention = AttentionBlock::own(w, &name, vq.dim, &heads, dtype)?;
            let names = (&*format!("{name}.norm2"), &*format!("{name}.ff"));
            let feed_forward = FeedForward::load(w, names, vq.dim, vq.ff, dtype)?;
            Ok((attention, feed_forward))
        };
        let wide = config.parts.len() * config.code_dim;
        let motion_dim = config.motion_dim;
        let mut decoder = Self {
            dtype,
            dim: vq.dim,
            ff: vq.ff,
            codebooks: config
                .parts
                .iter()
                .map(codebook)
                .collect::<Result<_, _>>()?,
            code_dim: config.code_dim,
            input: Linear::load(w, "vq.decoder.input", wide, vq.dim, dtype)?,
            layers: (0..vq.decoder_layers)
                .map(layer)
                .collect::<Result<_, ModelError>>()?,
            norm: Norm::load(w, "vq.decoder.norm", vq.dim)?,
            output: Linear::load(w, "vq.decoder.output", vq.dim, motion_dim, dtype)?,
            heads,
        };
        decoder.gather();
        Ok(decoder)
    }

    /// All matrices together, in the order of their use.
    fn gather(&mut self) {
        let layers = self.layers.iter_mut();
        let layers = layers.flat_map(|(a, f)| a.matrices().into_iter().chain(f.matrices()));
        let (input, output) = (self.input.matrix(), self.output.matrix());
        gather([input].into_iter().chain(layers).chain([output]));
    }

    /// Number format of the weights.
    pub fn dtype(&self) -> Dtype {
        self.dtype
    }

    /// A stream before its first frame.
    pub fn start(&self) -> DecoderState {
        let dtype = self.dtype;
        let widest = (3 * self.heads.wide()).max(self.output.outputs());
        let ring = |_| Ring::new(&self.heads, dtype);
        DecoderState {
            clock: Clock::new(self.heads.window),
            rings: (0..self.layers.len()).map(ring).collect(),
            codes: Input::new(self.codebooks.len() * self.code_dim, 1, dtype),
            work: Work::new(self.dim, widest, self.ff, 1, dtype),
            room: AttentionWork::new(&self.heads, 1, dtype),
        }
    }

    /// The next frame, 137 normalised numbers, from one code per part.
    pub fn step<'a>(&self, team: &Team, state: &'a mut DecoderState, codes: &[usize]) -> &'a [f32] {
        let DecoderState {
            clock,
            rings,
            codes: input,
            work,
            room,
        } = state;
        let embedded = input.lane_mut(0).chunks_exact_mut(self.code_dim);
        for ((to, table), code) in embedded.zip(&self.codebooks).zip(codes) {
            to.copy_from_slice(table.row(*code));
        }
        input.ready(team.cpu());
        let nothing = After::Nothing;
        let x = self.input.forward(team, input, &mut work.products, nothing);
        work.x.copy_from_slice(x);
        for ((attention, feed_forward), ring) in self.layers.iter().zip(rings) {
            let ring = std::slice::from_mut(ring);
            attention.step(team, (&self.heads, clock), ring, None, work, room);
            feed_forward.step(team, work);
        }
        clock.advance();
        self.norm.forward(team.cpu(), &work.x, &mut work.normed);
        self.output
            .forward(team, &work.normed, &mut work.products, nothing)
    }

    /// Bytes of keys and values that a step reads once the window is full.
    pub fn cache_bytes(&self) -> usize {
        self.layers.len() * Ring::new(&self.heads, self.dtype).bytes()
    }

    /// Bytes of weights that a step reads.
    pub fn bytes(&self) -> usize {
        let layers = self.layers.iter().map(|(a, f)| a.bytes() + f.bytes());
        self.input.bytes() + layers.sum::<usize>() + self.output.bytes()
    }
}

impl DecoderState {
    /// Forgets all frames.
    pub fn restart(&mut self) {
        self.clock.jump(0);
    }

    /// Stands at a frame as if all before had been processed (with zeros): to
    /// measure what a step takes there.
    pub fn jump(&mut self, frame: u64) {
        self.clock.jump(frame);
    }
}
