//! Style conditioning: a learned vector for each style scales every layer of
//! MotionSeq (eq. 5 of the paper, as a residual branch).
//!
//! A dance may also be given a vector that has no name ([`super::ClipText`]).
//! Scales are computed once for a dance, not in every step, and are the same for
//! both engines.

use crate::engine::{After, EmbeddingTable, Input, PackedLinear, Pool};
use crate::error::ModelError;
use crate::weights::{Dtype, Weights};

/// The style of a dance in no style: what the model learned from dances without one.
pub const NO_STYLE: &str = "none";

/// The row of a style in the table of vectors; [`NO_STYLE`] has the last one.
pub(crate) fn style_index(styles: &[String], name: &str) -> Result<usize, ModelError> {
    let found = styles.iter().position(|style| style == name);
    let found = found.or((name == NO_STYLE).then_some(styles.len()));
    found.ok_or_else(|| ModelError::UnknownStyle {
        found: name.to_owned(),
        known: styles.iter().cloned().chain([NO_STYLE.into()]).collect(),
    })
}

/// The vectors of the styles, and how each layer turns one into its scale.
#[derive(Clone, Debug)]
pub(crate) struct StyleConditioning {
    styles: usize,
    vectors: EmbeddingTable,
    layers: Vec<PackedLinear>,
    dtype: Dtype,
}

impl StyleConditioning {
    /// Weights are kept as f16 beside narrower formats: they are read too seldom
    /// for those to save time.
    pub fn load(w: &Weights, dtype: Dtype) -> Result<Self, ModelError> {
        let seq = &w.config().seq;
        let dtype = match dtype {
            Dtype::F32 => Dtype::F32,
            _ => Dtype::F16,
        };
        let layer = |i| {
            let name = format!("seq.layers.{i}.style.scale");
            PackedLinear::load(w, &name, seq.style_dim, seq.dim, dtype)
        };
        let rows = seq.styles.len() + 1;
        Ok(Self {
            styles: seq.styles.len(),
            vectors: EmbeddingTable::load(w, "seq.style.weight", rows, seq.style_dim)?,
            layers: (0..seq.layers).map(layer).collect::<Result<_, _>>()?,
            dtype,
        })
    }

    /// The learned vector of a style; none is the null style.
    pub fn vector(&self, style: Option<usize>) -> &[f32] {
        self.vectors.row(style.map_or(self.styles, |style| style.min(self.styles)))
    }

    /// The scale of each layer, one after another.
    pub fn scales(&self, vector: &[f32]) -> Vec<f32> {
        let pool = Pool::new(1);
        let mut input = Input::new(vector.len(), 1, self.dtype);
        input.lane_mut(0).copy_from_slice(vector);
        let scale = |layer: &PackedLinear| {
            let mut scale = vec![0.0; layer.outputs()];
            layer.forward(&pool.team(), &input, &mut scale, After::Nothing);
            scale
        };
        self.layers.iter().flat_map(scale).collect()
    }
}
