//! Stage 1's causal decoder: the codes of a frame to its 137 numbers
//! (normalised), a frame at a time or all at once with the same result.

use candle_core::{Device, Result as TensorResult, Tensor};

use super::attention::{Ring, RingClock, one_shot_bias};
use super::config::VqConfig;
use super::layers::{Layer, Linear, Norm};
use super::weights::Weights;
use crate::error::ModelError;

/// The decoder's weights.
#[derive(Clone, Debug)]
pub struct VqDecoder {
    config: VqConfig,
    /// One table [codes, code_dim] per body part.
    codebooks: Vec<Tensor>,
    input: Linear,
    layers: Vec<Layer>,
    norm: Norm,
    output: Linear,
}

/// Where one stream of frames stands: rotating caches, constant memory.
#[derive(Debug)]
pub struct DecoderState {
    clock: RingClock,
    rings: Vec<Ring>,
}

impl VqDecoder {
    /// Takes the tensors under `vq.` out of the file.
    pub fn load(w: &Weights) -> Result<Self, ModelError> {
        let config = w.config();
        let vq = config.vq.clone();
        let codebooks = config.parts.iter().map(|part| {
            w.tensor(
                &format!("vq.codebook.{part}"),
                &[config.codes, config.code_dim],
            )
        });
        let layers = (0..vq.decoder_layers).map(|i| {
            let name = format!("vq.decoder.layers.{i}");
            Layer::load(w, &name, vq.dim, vq.heads, vq.ff)
        });
        let wide = config.parts.len() * config.code_dim;
        Ok(Self {
            codebooks: codebooks.collect::<Result<_, _>>()?,
            input: Linear::load(w, "vq.decoder.input", wide, vq.dim)?,
            layers: layers.collect::<Result<_, _>>()?,
            norm: Norm::load(w, "vq.decoder.norm", vq.dim)?,
            output: Linear::load(w, "vq.decoder.output", vq.dim, config.motion_dim)?,
            config: vq,
        })
    }

    /// A stream before its first frame.
    pub fn start(&self) -> Result<DecoderState, ModelError> {
        let vq = &self.config;
        let ring = |_| Ring::new(vq.heads, vq.decoder_window, vq.dim);
        Ok(DecoderState {
            clock: RingClock::new(vq.decoder_window),
            rings: (0..vq.decoder_layers)
                .map(ring)
                .collect::<TensorResult<_>>()?,
        })
    }

    /// The next frame, 137 normalised numbers, from one code per part.
    pub fn step(&self, state: &mut DecoderState, codes: &[usize]) -> Result<Vec<f32>, ModelError> {
        let mut x = self.input.forward(&self.embed(&[codes.to_vec()])?)?;
        let (slot, bias) = (
            state.clock.slot(),
            state.clock.bias(&self.config.decoder_slopes)?,
        );
        for (layer, ring) in self.layers.iter().zip(&state.rings) {
            x = layer.step(&x, ring, slot, &bias)?;
        }
        state.clock.advance();
        Ok(self
            .output
            .forward(&self.norm.forward(&x)?)?
            .squeeze(0)?
            .to_vec1()?)
    }

    /// All frames at once: rows of codes to rows of 137 normalised numbers.
    pub fn one_shot(&self, codes: &[Vec<usize>]) -> Result<Vec<Vec<f32>>, ModelError> {
        let vq = &self.config;
        let bias = one_shot_bias(codes.len(), &vq.decoder_slopes, vq.decoder_window, 0)?;
        let mut x = self.input.forward(&self.embed(codes)?)?;
        for layer in &self.layers {
            x = layer.one_shot(&x, &bias)?;
        }
        Ok(self.output.forward(&self.norm.forward(&x)?)?.to_vec2()?)
    }

    /// Code vectors of all parts side by side, [frames, parts * code_dim].
    fn embed(&self, codes: &[Vec<usize>]) -> TensorResult<Tensor> {
        let parts: Vec<Tensor> = self
            .codebooks
            .iter()
            .enumerate()
            .map(|(part, table)| table.index_select(&column(codes, part)?, 0))
            .collect::<TensorResult<_>>()?;
        Tensor::cat(&parts, 1)
    }
}

/// The codes of one part as an index tensor.
pub(crate) fn column(codes: &[Vec<usize>], part: usize) -> TensorResult<Tensor> {
    let column: Vec<u32> = codes.iter().map(|row| row[part] as u32).collect();
    Tensor::from_vec(column, codes.len(), &Device::Cpu)
}
