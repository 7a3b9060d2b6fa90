//! Codebooks: one table of vectors for each body part.
//!
//! The decoder looks vectors up by code ([`Codebooks`]); the encoder looks for
//! the code whose vector is nearest ([`NearestCode`]).

use candle_core::{Result as TensorResult, Tensor};

use crate::engine::EmbeddingTable;
use crate::error::ModelError;
use crate::weights::Weights;

/// The codebooks of all body parts, for look-up by code.
#[derive(Clone, Debug)]
pub(crate) struct Codebooks {
    tables: Vec<EmbeddingTable>,
    code_dim: usize,
}

impl Codebooks {
    pub fn load(w: &Weights) -> Result<Self, ModelError> {
        let config = w.config();
        let table = |part| {
            let name = format!("vq.codebook.{part}");
            EmbeddingTable::load(w, &name, config.codes, config.code_dim)
        };
        Ok(Self {
            tables: config.parts.iter().map(table).collect::<Result<_, _>>()?,
            code_dim: config.code_dim,
        })
    }

    /// Numbers of the vectors of all parts side by side.
    pub fn width(&self) -> usize {
        self.tables.len() * self.code_dim
    }

    /// Writes the vectors of one code per part side by side.
    pub fn look_up(&self, codes: &[usize], out: &mut [f32]) {
        let out = out.chunks_exact_mut(self.code_dim);
        for ((to, table), code) in out.zip(&self.tables).zip(codes) {
            to.copy_from_slice(table.row(*code));
        }
    }
}

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
