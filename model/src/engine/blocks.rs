//! The pre-norm blocks that both networks are made of, a frame at a time on the
//! own engine, and the memory that they work in.

use super::attention::AttentionScratch;
use super::input::{Input, add_lane};
use super::kv_cache::{AttentionShape, CachePosition, KvCache};
use super::linear::{After, LayerNorm, PackedLinear};
use super::pool::Team;
use crate::error::ModelError;
use crate::weights::{Dtype, PackedMatrix, Weights};

/// The vectors of all lanes, and memory for what is computed from them.
#[derive(Clone, Debug)]
pub(crate) struct BlockScratch {
    pub lanes: usize,
    pub dim: usize,
    pub x: Vec<f32>,
    pub normed: Input,
    pub products: Vec<f32>,
    hidden: Input,
}

impl BlockScratch {
    /// For vectors of `dim`, products of up to `widest`, feed-forward blocks of `ff`.
    pub fn new(dim: usize, widest: usize, ff: usize, lanes: usize, dtype: Dtype) -> Self {
        Self {
            lanes,
            dim,
            x: vec![0.0; dim * lanes],
            normed: Input::new(dim, lanes, dtype),
            products: vec![0.0; widest.max(ff).max(dim) * lanes],
            hidden: Input::new(ff, lanes, dtype),
        }
    }

    pub fn lane_mut(&mut self, lane: usize) -> &mut [f32] {
        &mut self.x[lane * self.dim..][..self.dim]
    }
}

/// Adds the layer's output to the vectors of all lanes.
fn add(team: &Team, layer: &PackedLinear, input: &Input, products: &mut [f32], x: &mut [f32]) {
    let (lanes, dim) = (input.lanes(), layer.outputs());
    let products = layer.forward(team, input, products, After::Nothing);
    for (lane, x) in x.chunks_exact_mut(dim).enumerate() {
        add_lane(x, products, lane, lanes);
    }
}

#[derive(Clone, Debug)]
pub(crate) struct AttentionBlock {
    norm: LayerNorm,
    /// To queries; in self-attention to keys and values as well.
    project: PackedLinear,
    out: PackedLinear,
}

/// Which attention a block is, and the names of its weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AttentionKind {
    Own,
    /// Keys and values are computed for all layers at once (see `MotionSeq`).
    Cross,
}

impl AttentionBlock {
    pub fn load(
        w: &Weights,
        (name, kind): (&str, AttentionKind),
        dim: usize,
        shape: &AttentionShape,
        dtype: Dtype,
    ) -> Result<Self, ModelError> {
        let wide = shape.wide();
        let (norm, attention, project, outputs) = match kind {
            AttentionKind::Own => ("norm1", "attn", "qkv", 3 * wide),
            AttentionKind::Cross => ("norm2", "cross", "q", wide),
        };
        let linear = |layer: &str, input, output| {
            PackedLinear::load(w, &format!("{name}.{attention}.{layer}"), input, output, dtype)
        };
        Ok(Self {
            norm: LayerNorm::load(w, &format!("{name}.{norm}"), dim)?,
            project: linear(project, dim, outputs)?,
            out: linear("out", wide, dim)?,
        })
    }

    /// `given`: of cross-attention, the products that hold keys and values,
    /// from an output on.
    pub fn step(
        &self,
        team: &Team,
        (shape, position): (&AttentionShape, &CachePosition),
        caches: &mut [KvCache],
        given: Option<(&[f32], usize)>,
        work: &mut BlockScratch,
        scratch: &mut AttentionScratch,
    ) {
        self.norm.forward(team.cpu(), &work.x, &mut work.normed);
        let products = &mut work.products;
        let products = self.project.forward(team, &work.normed, products, After::Nothing);
        scratch.set_queries(shape, products);
        let given = given.unwrap_or((products, shape.wide()));
        scratch.store(team, shape, caches, position.slot(), given);
        let attended = scratch.attend(team, shape, position, caches);
        add(team, &self.out, attended, &mut work.products, &mut work.x);
    }

    /// The matrices, in the order of their use.
    pub fn matrices(&mut self) -> [&mut PackedMatrix; 2] {
        [self.project.matrix(), self.out.matrix()]
    }

    pub fn bytes(&self) -> usize {
        self.project.bytes() + self.out.bytes()
    }
}

/// Layer norm and two linear layers with an activation between them.
#[derive(Clone, Debug)]
pub(crate) struct FeedForwardBlock {
    norm: LayerNorm,
    up: PackedLinear,
    down: PackedLinear,
    activate: After,
}

impl FeedForwardBlock {
    pub fn load(
        w: &Weights,
        (norm, name): (&str, &str),
        dim: usize,
        hidden: usize,
        dtype: Dtype,
    ) -> Result<Self, ModelError> {
        Ok(Self {
            norm: LayerNorm::load(w, norm, dim)?,
            up: PackedLinear::load(w, &format!("{name}.up"), dim, hidden, dtype)?,
            down: PackedLinear::load(w, &format!("{name}.down"), hidden, dim, dtype)?,
            activate: After::Activate(w.config().activation),
        })
    }

    pub fn step(&self, team: &Team, work: &mut BlockScratch) {
        self.norm.forward(team.cpu(), &work.x, &mut work.normed);
        let products = &mut work.products;
        let up = self.up.forward(team, &work.normed, products, self.activate);
        work.hidden.take(team.cpu(), up);
        add(team, &self.down, &work.hidden, &mut work.products, &mut work.x);
    }

    /// The matrices, in the order of their use.
    pub fn matrices(&mut self) -> [&mut PackedMatrix; 2] {
        [self.up.matrix(), self.down.matrix()]
    }

    pub fn bytes(&self) -> usize {
        self.up.bytes() + self.down.bytes()
    }
}
