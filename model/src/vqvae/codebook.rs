//! Codebooks: one table of vectors for each body part, in which the decoder looks
//! vectors up by code. The search for the nearest one is in `nearest_code`.

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
