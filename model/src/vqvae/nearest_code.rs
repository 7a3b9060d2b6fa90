//! Quantisation: the codes whose vectors are nearest to what the encoder gives, each to
//! what those before it left.

use candle_core::{Result as TensorResult, Tensor};

use crate::error::ModelError;
use crate::weights::Weights;

/// A codebook of one body part, for quantisation.
#[derive(Clone, Debug)]
pub(crate) struct NearestCode {
    vectors: Tensor,
    vectors_t: Tensor,
    /// Squared length of each vector, [codes].
    squared: Tensor,
}

impl NearestCode {
    pub fn load(w: &Weights, name: &str) -> Result<Self, ModelError> {
        let shape = [w.config().codes, w.config().code_dim];
        let vectors = w.tensor(&format!("vq.codebook.{name}"), &shape)?;
        Ok(Self { squared: vectors.sqr()?.sum(1)?, vectors_t: vectors.t()?, vectors })
    }

    /// The nearest code of each row of [frames, code_dim], and what it leaves of the row.
    pub fn quantise(&self, latent: &Tensor) -> TensorResult<(Vec<u32>, Tensor)> {
        // |z - c|^2 without |z|^2, which is the same for every code.
        let products = (latent.matmul(&self.vectors_t)? * 2.0)?;
        let distance = self.squared.broadcast_sub(&products)?;
        let nearest = distance.argmin(1)?;
        let left = (latent - self.vectors.index_select(&nearest, 0)?)?;
        Ok((nearest.to_vec1()?, left))
    }
}
