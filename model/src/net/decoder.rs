//! Stage 1's causal decoder in candle, all frames at once: the check of the one
//! that streams ([`super::VqDecoder`]).

use candle_core::{Device, Result as TensorResult, Tensor};

use super::attention::one_shot_bias;
use super::config::VqConfig;
use super::layers::{Layer, Linear, Norm};
use super::weights::Weights;
use crate::error::ModelError;

/// The decoder's weights.
#[derive(Clone, Debug)]
pub struct OneShotDecoder {
    config: VqConfig,
    /// One table [codes, code_dim] per body part.
    codebooks: Vec<Tensor>,
    input: Linear,
    layers: Vec<Layer>,
    norm: Norm,
    output: Linear,
}

impl OneShotDecoder {
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
            let heads = (vq.heads, vq.decoder_head_dim());
            Layer::load(w, &name, vq.dim, heads, vq.ff)
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
