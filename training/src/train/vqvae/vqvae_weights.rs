//! The trained VQ-VAE that gives MotionSeq its codes, or that another run of stage 1 begins with.

use crate::train::data::sha256;
use crate::train::error::TrainError;
use crate::train::settings::TrainingSettings;
use crate::train::tensors::{Tensors, floats, read};
use servodance_model::config::ModelConfig;
use servodance_model::vqvae::VqEncoder;
use servodance_model::weights::Weights;

/// The weights of a trained VQ-VAE.
#[derive(Clone, Debug)]
pub struct VqVaeWeights {
    config: ModelConfig,
    pub(in crate::train) encoder: VqEncoder,
    pub(in crate::train) tensors: Tensors,
    /// SHA-256 of the file, in hexadecimal.
    pub(in crate::train) sha256: String,
}

impl VqVaeWeights {
    /// Weights with encoders from the bytes of a file; `source` names it in errors.
    pub fn open(bytes: &[u8], source: &str) -> Result<Self, TrainError> {
        let weights = Weights::open(bytes, source)?;
        let encoder = VqEncoder::load(&weights)?;
        let tensors = read(bytes, &["vq.", "norm.motion_"])
            .map_err(|e| TrainError::Settings(format!("{source}: {e}")))?;
        let sha256 = sha256(bytes);
        Ok(Self { config: weights.config().clone(), encoder, tensors, sha256 })
    }

    /// The settings with the codes, parts and sizes of this VQ-VAE.
    pub(in crate::train) fn with_own_sizes(&self, settings: TrainingSettings) -> TrainingSettings {
        let model = ModelConfig {
            seq: settings.model.seq,
            preset: settings.model.preset,
            music: settings.model.music,
            music_dim: settings.model.music_dim,
            ..self.config.clone()
        };
        TrainingSettings { model, ..settings }
    }

    /// A copy of a tensor; fails where it has another number of values.
    pub(in crate::train) fn floats(
        &self,
        name: &str,
        count: usize,
    ) -> Result<Vec<f32>, TrainError> {
        let values = floats(&self.tensors, name, count);
        values.map_err(|e| TrainError::Settings(format!("weights of stage 1: {e}")))
    }
}
