//! Codebooks: tables of vectors for each body part, in which the decoder looks
//! vectors up by code. The search for the nearest one is in `nearest_code`.

use crate::config::CodePlace;
use crate::engine::EmbeddingTable;
use crate::error::ModelError;
use crate::weights::Weights;

/// The codebooks of all body parts, for look-up by code.
#[derive(Clone, Debug)]
pub(crate) struct Codebooks {
    /// For each code of a frame, and which part it is of.
    tables: Vec<(usize, EmbeddingTable)>,
    parts: usize,
    code_dim: usize,
}

impl Codebooks {
    pub fn load(w: &Weights) -> Result<Self, ModelError> {
        let config = w.config();
        let table = |place: CodePlace| {
            let name = format!("vq.codebook.{}", config.code_name(place));
            Ok((place.part, EmbeddingTable::load(w, &name, config.codes, config.code_dim)?))
        };
        Ok(Self {
            tables: config
                .code_places()
                .into_iter()
                .map(table)
                .collect::<Result<_, ModelError>>()?,
            parts: config.parts.len(),
            code_dim: config.code_dim,
        })
    }

    /// Numbers of the vectors of all parts side by side.
    pub fn width(&self) -> usize {
        self.parts * self.code_dim
    }

    /// Writes the vectors of all parts side by side, each the sum of its codes'.
    pub fn look_up(&self, codes: &[usize], out: &mut [f32]) {
        out.fill(0.0);
        for ((part, table), code) in self.tables.iter().zip(codes) {
            let to = &mut out[part * self.code_dim..][..self.code_dim];
            to.iter_mut().zip(table.row(*code)).for_each(|(sum, v)| *sum += v);
        }
    }
}
