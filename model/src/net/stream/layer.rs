//! The pre-norm blocks that both networks are made of, and the room they work in.

use crate::error::ModelError;
use crate::net::config::Activation;
use crate::net::engine::{
    After, Clock, Dtype, Heads, Input, Linear, Matrix, Norm, Ring, Scene, Team, add_lane,
};
use crate::net::weights::Weights;

/// Table of vectors, looked up by code.
#[derive(Clone, Debug)]
pub(super) struct Table {
    dim: usize,
    rows: Vec<f32>,
}

impl Table {
    pub fn load(w: &Weights, name: &str, rows: usize, dim: usize) -> Result<Self, ModelError> {
        let rows = w.floats(name, &[rows, dim])?;
        Ok(Self { dim, rows })
    }

    /// The vector of a code.
    pub fn row(&self, code: usize) -> &[f32] {
        &self.rows[code * self.dim..][..self.dim]
    }
}

/// The stream's vectors, and room for what is computed from them.
#[derive(Clone, Debug)]
pub(super) struct Work {
    pub lanes: usize,
    pub dim: usize,
    /// One vector after another.
    pub x: Vec<f32>,
    pub normed: Input,
    pub products: Vec<f32>,
    hidden: Input,
}

impl Work {
    /// For vectors of `dim`, products of up to `widest` and feed-forward blocks
    /// of `ff` numbers.
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

/// Room for an attention.
#[derive(Clone, Debug)]
pub(super) struct AttentionWork {
    scene: Scene,
    mixed: Input,
}

impl AttentionWork {
    pub fn new(heads: &Heads, lanes: usize, dtype: Dtype) -> Self {
        Self {
            scene: Scene::new(heads, lanes),
            mixed: Input::new(heads.wide(), lanes, dtype),
        }
    }

    /// Takes queries from the first products.
    fn ask(&mut self, heads: &Heads, products: &[f32], lanes: usize) {
        for lane in 0..lanes {
            self.scene.ask(heads, products, 0, (lane, lanes));
        }
    }

    /// Takes keys and values from products, from output `first` on, into the
    /// rings of the lanes.
    fn remember(
        &mut self,
        team: &Team,
        heads: &Heads,
        rings: &mut [Ring],
        clock: &Clock,
        given: (&[f32], usize),
    ) {
        let (cpu, slot, lanes) = (team.cpu(), clock.slot(), rings.len());
        for (lane, ring) in rings.iter_mut().enumerate() {
            let lane = (lane, lanes);
            self.scene.remember(cpu, heads, ring, slot, given, lane);
        }
    }

    /// Attends and adds what comes out to the stream.
    fn attend(
        &mut self,
        team: &Team,
        heads: &Heads,
        clock: &Clock,
        rings: &[Ring],
        out: &Linear,
        work: &mut Work,
    ) {
        self.scene.attend(team, heads, clock, rings);
        for lane in 0..work.lanes {
            self.scene.found(heads, lane, self.mixed.lane_mut(lane));
        }
        self.mixed.ready(team.cpu());
        add(team, out, &self.mixed, &mut work.products, &mut work.x);
    }
}

/// Adds the layer's output to the stream.
fn add(team: &Team, layer: &Linear, input: &Input, products: &mut [f32], x: &mut [f32]) {
    let (lanes, dim) = (input.lanes(), layer.outputs());
    let products = layer.forward(team, input, products, After::Nothing);
    for (lane, x) in x.chunks_exact_mut(dim).enumerate() {
        add_lane(x, products, lane, lanes);
    }
}

/// Norm and attention.
#[derive(Clone, Debug)]
pub(super) struct AttentionBlock {
    norm: Norm,
    /// To queries; of self-attention, to keys and values as well.
    ask: Linear,
    out: Linear,
}

impl AttentionBlock {
    /// Self-attention.
    pub fn own(
        w: &Weights,
        name: &str,
        dim: usize,
        heads: &Heads,
        dtype: Dtype,
    ) -> Result<Self, ModelError> {
        let wide = heads.wide();
        Ok(Self {
            norm: Norm::load(w, &format!("{name}.norm1"), dim)?,
            ask: Linear::load(w, &format!("{name}.attn.qkv"), dim, 3 * wide, dtype)?,
            out: Linear::load(w, &format!("{name}.attn.out"), wide, dim, dtype)?,
        })
    }

    /// Cross-attention; keys and values are computed for all layers at once
    /// (see `MotionSeq`).
    pub fn cross(
        w: &Weights,
        name: &str,
        dim: usize,
        heads: &Heads,
        dtype: Dtype,
    ) -> Result<Self, ModelError> {
        let wide = heads.wide();
        Ok(Self {
            norm: Norm::load(w, &format!("{name}.norm2"), dim)?,
            ask: Linear::load(w, &format!("{name}.cross.q"), dim, wide, dtype)?,
            out: Linear::load(w, &format!("{name}.cross.out"), wide, dim, dtype)?,
        })
    }

    /// `given` are the products that hold keys and values, from an output on;
    /// none for self-attention.
    pub fn step(
        &self,
        team: &Team,
        (heads, clock): (&Heads, &Clock),
        rings: &mut [Ring],
        given: Option<(&[f32], usize)>,
        work: &mut Work,
        room: &mut AttentionWork,
    ) {
        self.norm.forward(team.cpu(), &work.x, &mut work.normed);
        let (products, lanes) = (&mut work.products, work.lanes);
        let products = self
            .ask
            .forward(team, &work.normed, products, After::Nothing);
        room.ask(heads, products, lanes);
        let given = given.unwrap_or((products, heads.wide()));
        room.remember(team, heads, rings, clock, given);
        room.attend(team, heads, clock, rings, &self.out, work);
    }

    /// Its matrices, in the order of their use.
    pub fn matrices(&mut self) -> [&mut Matrix; 2] {
        [self.ask.matrix(), self.out.matrix()]
    }

    pub fn bytes(&self) -> usize {
        self.ask.bytes() + self.out.bytes()
    }
}

/// Norm and two linear layers with an activation between them.
#[derive(Clone, Debug)]
pub(super) struct FeedForward {
    norm: Norm,
    up: Linear,
    down: Linear,
    activation: Activation,
}

impl FeedForward {
    pub fn load(
        w: &Weights,
        (norm, name): (&str, &str),
        dim: usize,
        hidden: usize,
        dtype: Dtype,
    ) -> Result<Self, ModelError> {
        Ok(Self {
            norm: Norm::load(w, norm, dim)?,
            up: Linear::load(w, &format!("{name}.up"), dim, hidden, dtype)?,
            down: Linear::load(w, &format!("{name}.down"), hidden, dim, dtype)?,
            activation: w.config().activation,
        })
    }

    pub fn step(&self, team: &Team, work: &mut Work) {
        self.norm.forward(team.cpu(), &work.x, &mut work.normed);
        let after = After::Activate(self.activation);
        let up = self
            .up
            .forward(team, &work.normed, &mut work.products, after);
        work.hidden.take(team.cpu(), up);
        add(
            team,
            &self.down,
            &work.hidden,
            &mut work.products,
            &mut work.x,
        );
    }

    /// Its matrices, in the order of their use.
    pub fn matrices(&mut self) -> [&mut Matrix; 2] {
        [self.up.matrix(), self.down.matrix()]
    }

    pub fn bytes(&self) -> usize {
        self.up.bytes() + self.down.bytes()
    }
}
