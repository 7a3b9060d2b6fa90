//! The VQ-VAE's causal decoder on the candle engine.

use candle_core::{Device, Tensor};

use super::codebook::Codebooks;
use crate::engine::AttentionWindow;
use crate::engine::candle::{RoundedWeights, TensorCache, TensorTransformer, TransformerSizes};
use crate::error::ModelError;
use crate::weights::{Dtype, Weights};

#[derive(Clone, Debug)]
pub(crate) struct CandleDecoder {
    dtype: Dtype,
    codebooks: Codebooks,
    transformer: TensorTransformer,
}

#[derive(Clone, Debug)]
pub(crate) struct CandleDecoderState {
    caches: Vec<TensorCache>,
    motion: Vec<f32>,
}

impl CandleDecoder {
    pub fn load(w: &Weights, dtype: Dtype) -> Result<Self, ModelError> {
        let (config, vq) = (w.config(), &w.config().vq);
        let codebooks = Codebooks::load(w)?;
        let sizes = TransformerSizes {
            input: codebooks.width(),
            dim: vq.dim,
            ff: vq.ff,
            output: config.motion_dim,
            layers: vq.decoder_layers,
            head_width: vq.decoder_head_dim(),
            slopes: vq.decoder_slopes.clone(),
            window: AttentionWindow { frames: vq.decoder_window, ahead: 0 },
            activation: config.activation,
            skip: vq.skip,
        };
        let transformer = TensorTransformer::load(&RoundedWeights(w, dtype), "vq.decoder", sizes)?;
        Ok(Self { dtype, codebooks, transformer })
    }

    pub fn start(&self) -> CandleDecoderState {
        CandleDecoderState { caches: self.transformer.start(self.dtype), motion: Vec::new() }
    }

    /// The next frames, one row of codes for each; gives their numbers.
    pub fn frames<'a>(
        &self,
        state: &'a mut CandleDecoderState,
        codes: &[&[usize]],
    ) -> Result<&'a [f32], ModelError> {
        let wide = self.codebooks.width();
        let mut vectors = vec![0.0; codes.len() * wide];
        for (codes, row) in codes.iter().zip(vectors.chunks_exact_mut(wide)) {
            self.codebooks.look_up(codes, row);
        }
        let x = Tensor::from_vec(vectors, (codes.len(), wide), &Device::Cpu)?;
        let motion = self.transformer.forward(&x, &mut state.caches)?;
        state.motion = motion.flatten_all()?.to_vec1()?;
        Ok(&state.motion)
    }

    pub fn cache_bytes(&self) -> usize {
        self.start().caches.iter().map(TensorCache::bytes).sum()
    }

    pub fn bytes(&self) -> usize {
        self.transformer.bytes()
    }
}

impl CandleDecoderState {
    pub fn jump(&mut self, frame: u64) {
        self.caches.iter_mut().for_each(|cache| cache.jump(frame));
    }
}
