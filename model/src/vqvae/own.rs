//! The VQ-VAE's causal decoder on the own engine.

use super::codebook::Codebooks;
use crate::engine::{
    After, AttentionBlock, AttentionKind, AttentionScratch, AttentionShape, BlockScratch,
    CachePosition, FeedForwardBlock, Input, KvCache, LayerNorm, PackedLinear, Team,
};
use crate::error::ModelError;
use crate::weights::{Dtype, Weights, gather};

#[derive(Clone, Debug)]
pub(super) struct OwnDecoder {
    dtype: Dtype,
    shape: AttentionShape,
    dim: usize,
    ff: usize,
    codebooks: Codebooks,
    input: PackedLinear,
    layers: Vec<(AttentionBlock, FeedForwardBlock)>,
    norm: LayerNorm,
    output: PackedLinear,
    /// Adds a linear map of the codes' vectors.
    skip: Option<PackedLinear>,
}

#[derive(Clone, Debug)]
pub(super) struct OwnDecoderState {
    position: CachePosition,
    caches: Vec<KvCache>,
    codes: Input,
    work: BlockScratch,
    scratch: AttentionScratch,
    motion: Vec<f32>,
}

impl OwnDecoder {
    pub fn load(w: &Weights, dtype: Dtype) -> Result<Self, ModelError> {
        let config = w.config();
        let vq = &config.vq;
        let shape = AttentionShape {
            slopes: vq.decoder_slopes.clone(),
            width: vq.decoder_head_dim(),
            window: vq.decoder_window,
        };
        let layer = |i| {
            let name = format!("vq.decoder.layers.{i}");
            let own = (&*name, AttentionKind::Own);
            let attention = AttentionBlock::load(w, own, vq.dim, &shape, dtype)?;
            let names = (&*format!("{name}.norm2"), &*format!("{name}.ff"));
            let feed_forward = FeedForwardBlock::load(w, names, vq.dim, vq.ff, dtype)?;
            Ok((attention, feed_forward))
        };
        let codebooks = Codebooks::load(w)?;
        let (wide, motion_dim) = (codebooks.width(), config.motion_dim);
        let skip = || PackedLinear::load(w, "vq.decoder.skip", wide, motion_dim, dtype);
        let skip = vq.skip.then(skip);
        let mut decoder = Self {
            dtype,
            dim: vq.dim,
            ff: vq.ff,
            codebooks,
            input: PackedLinear::load(w, "vq.decoder.input", wide, vq.dim, dtype)?,
            layers: (0..vq.decoder_layers).map(layer).collect::<Result<_, ModelError>>()?,
            norm: LayerNorm::load(w, "vq.decoder.norm", vq.dim)?,
            output: PackedLinear::load(w, "vq.decoder.output", vq.dim, motion_dim, dtype)?,
            skip: skip.transpose()?,
            shape,
        };
        decoder.gather();
        Ok(decoder)
    }

    /// All matrices together, in the order of their use.
    fn gather(&mut self) {
        let layers = self.layers.iter_mut();
        let layers = layers.flat_map(|(a, f)| a.matrices().into_iter().chain(f.matrices()));
        let (input, output) = (self.input.matrix(), self.output.matrix());
        let skip = self.skip.iter_mut().map(PackedLinear::matrix);
        gather([input].into_iter().chain(layers).chain([output]).chain(skip));
    }

    pub fn start(&self) -> OwnDecoderState {
        let dtype = self.dtype;
        let widest = (3 * self.shape.wide()).max(self.output.outputs());
        OwnDecoderState {
            position: CachePosition::new(self.shape.window),
            caches: vec![KvCache::new(&self.shape, dtype); self.layers.len()],
            codes: Input::new(self.codebooks.width(), 1, dtype),
            work: BlockScratch::new(self.dim, widest, self.ff, 1, dtype),
            scratch: AttentionScratch::new(&self.shape, 1, dtype),
            motion: vec![0.0; self.output.outputs()],
        }
    }

    pub fn step<'a>(
        &self,
        team: &Team,
        state: &'a mut OwnDecoderState,
        codes: &[usize],
    ) -> &'a [f32] {
        let OwnDecoderState { position, caches, codes: input, work, scratch, motion } = state;
        self.codebooks.look_up(codes, input.lane_mut(0));
        input.ready(team.cpu());
        let nothing = After::Nothing;
        let x = self.input.forward(team, input, &mut work.products, nothing);
        work.x.copy_from_slice(x);
        for ((attention, feed_forward), cache) in self.layers.iter().zip(caches) {
            let cache = std::slice::from_mut(cache);
            attention.step(team, (&self.shape, position), cache, None, work, scratch);
            feed_forward.step(team, work);
        }
        position.advance();
        self.norm.forward(team.cpu(), &work.x, &mut work.normed);
        motion.copy_from_slice(self.output.forward(
            team,
            &work.normed,
            &mut work.products,
            nothing,
        ));
        if let Some(skip) = &self.skip {
            let skipped = skip.forward(team, input, &mut work.products, nothing);
            motion.iter_mut().zip(skipped).for_each(|(m, s)| *m += *s);
        }
        motion
    }

    pub fn cache_bytes(&self) -> usize {
        self.layers.len() * KvCache::new(&self.shape, self.dtype).bytes()
    }

    pub fn bytes(&self) -> usize {
        let layers = self.layers.iter().map(|(a, f)| a.bytes() + f.bytes());
        let skip = self.skip.as_ref().map_or(0, PackedLinear::bytes);
        self.input.bytes() + layers.sum::<usize>() + self.output.bytes() + skip
    }
}

impl OwnDecoderState {
    pub fn jump(&mut self, frame: u64) {
        self.position.jump(frame);
    }
}
