//! The trained VQ-VAE that gives MotionSeq its codes.

use crate::train::error::TrainError;
use crate::train::tensors::{Numbers, Tensors, read};
use servodance_model::config::ModelConfig;
use servodance_model::vqvae::VqEncoder;
use servodance_model::weights::Weights;

/// The weights of the VQ-VAE that MotionSeq builds on.
#[derive(Clone, Debug)]
pub struct VqVaeWeights {
    pub(super) config: ModelConfig,
    pub(super) encoder: VqEncoder,
    pub(super) tensors: Tensors,
}

impl VqVaeWeights {
    /// Weights with encoders from the bytes of a file; `source` names it in errors.
    pub fn open(bytes: &[u8], source: &str) -> Result<Self, TrainError> {
        let weights = Weights::open(bytes, source)?;
        let encoder = VqEncoder::load(&weights)?;
        let tensors = read(bytes, &["vq.", "norm.motion_"])
            .map_err(|e| TrainError::Settings(format!("{source}: {e}")))?;
        Ok(Self { config: weights.config().clone(), encoder, tensors })
    }

    pub(super) fn floats(&self, name: &str) -> Result<&[f32], TrainError> {
        match self.tensors.get(name) {
            Some((_, Numbers::F32(values))) => Ok(values),
            _ => Err(TrainError::Settings(format!("stage 1 lacks the tensor `{name}`"))),
        }
    }
}
