//! Quantisation: the code whose vector is nearest to what the encoder gives.

use candle_core::{Result as TensorResult, Tensor};

use crate::error::ModelError;
use crate::weights::Weights;

/// The codebook of one body part, for quantisation.
#[derive(Clone, Debug)]
pub(crate) struct NearestCode {
    vectors_t: Tensor,
    /// Squared length of each vector, [codes].
    squared: Tensor,
}

impl NearestCode {
    pub fn load(w: &Weights, part: &str) -> Result<Self, ModelError> {
        let shape = [w.config().codes, w.config().code_dim];
        let vectors = w.tensor(&format!("vq.codebook.{part}"), &shape)?;
        Ok(Self { squared: vectors.sqr()?.sum(1)?, vectors_t: vectors.t()? })
    }

    /// The nearest code of each row of [frames, code_dim].
    pub fn quantise(&self, latent: &Tensor) -> TensorResult<Vec<u32>> {
        // |z - c|^2 without |z|^2, which is the same for every code.
        let products = (latent.matmul(&self.vectors_t)? * 2.0)?;
        let distance = self.squared.broadcast_sub(&products)?;
        distance.argmin(1)?.to_vec1()
    }
}
