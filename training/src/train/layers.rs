//! The learned parts that both stages are made of, on the tape: the trainable
//! form of what [`servodance_model::engine`] runs, under the same names.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::ops::{Heads, Sight};
use super::parameters::{Id, Init, Parameters};
use super::tape::{Batch, Tape, Value};
use servodance_model::config::Activation;

/// Makes parameters: where they go and where their first numbers come from.
pub(crate) struct Maker<'a> {
    /// Where they go.
    pub parameters: &'a mut Parameters,
    /// Where their first numbers come from.
    pub rng: &'a mut ChaCha8Rng,
}

impl Maker<'_> {
    /// A tensor that weight decay leaves alone.
    pub fn tensor(&mut self, name: String, shape: &[usize], init: Init) -> Id {
        self.parameters.add(name, shape, init, false, self.rng)
    }

    fn matrix(&mut self, name: String, shape: &[usize], init: Init) -> Id {
        self.parameters.add(name, shape, init, true, self.rng)
    }
}

/// Channels that are dropped at random while training: whole ones of a
/// sequence, the same at every frame.
#[derive(Debug)]
pub(crate) struct Dropout<'a> {
    /// Share of them.
    pub rate: f32,
    /// What decides.
    pub rng: &'a mut ChaCha8Rng,
}

impl Dropout<'_> {
    /// `residual + drop(x W^T + b)`.
    fn onto(
        &mut self,
        t: &mut Tape,
        linear: &Linear,
        x: Value,
        residual: Value,
        batch: &Batch,
    ) -> Value {
        if self.rate == 0.0 {
            return linear.onto(t, x, residual);
        }
        let made = linear.forward(t, x);
        let kept = 1.0 / (1.0 - self.rate);
        let channels = t.columns(made) * batch.lengths.len();
        let keep = (0..channels)
            .map(|_| {
                if self.rng.random::<f32>() < self.rate {
                    0.0
                } else {
                    kept
                }
            })
            .collect();
        let dropped = t.dropout(made, batch.length, keep);
        t.add(residual, dropped)
    }
}

/// `x W^T + b`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Linear {
    weight: Id,
    bias: Id,
}

impl Linear {
    /// Uniform within one over the square root of the inputs, as in PyTorch.
    pub fn new(make: &mut Maker, name: &str, inputs: usize, outputs: usize) -> Self {
        let init = Init::Uniform((inputs as f32).powf(-0.5));
        Self::begun(make, name, inputs, outputs, init)
    }

    /// Begun in another way.
    pub fn begun(make: &mut Maker, name: &str, inputs: usize, outputs: usize, init: Init) -> Self {
        Self {
            weight: make.matrix(format!("{name}.weight"), &[outputs, inputs], init),
            bias: make.tensor(format!("{name}.bias"), &[outputs], init),
        }
    }

    pub fn forward(&self, t: &mut Tape, x: Value) -> Value {
        t.affine(x, self.weight, self.bias, None)
    }

    /// Plus a residual.
    pub fn onto(&self, t: &mut Tape, x: Value, residual: Value) -> Value {
        t.affine(x, self.weight, self.bias, Some(residual))
    }
}

/// Layer norm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Norm {
    weight: Id,
    bias: Id,
}

impl Norm {
    pub fn new(make: &mut Maker, name: &str, dim: usize) -> Self {
        Self {
            weight: make.tensor(format!("{name}.weight"), &[dim], Init::Constant(1.0)),
            bias: make.tensor(format!("{name}.bias"), &[dim], Init::Constant(0.0)),
        }
    }

    pub fn forward(&self, t: &mut Tape, x: Value) -> Value {
        t.layer_norm(x, self.weight, self.bias)
    }
}

/// Two linear layers with an activation between them, onto a residual.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FeedForward {
    up: Linear,
    down: Linear,
    activation: Activation,
}

impl FeedForward {
    pub fn new(
        make: &mut Maker,
        name: &str,
        dim: usize,
        hidden: usize,
        activation: Activation,
    ) -> Self {
        Self {
            up: Linear::new(make, &format!("{name}.up"), dim, hidden),
            down: Linear::new(make, &format!("{name}.down"), hidden, dim),
            activation,
        }
    }

    pub fn onto(
        &self,
        t: &mut Tape,
        x: Value,
        residual: Value,
        batch: &Batch,
        drop: &mut Dropout,
    ) -> Value {
        let wide = self.up.forward(t, x);
        let active = t.activate(wide, self.activation);
        drop.onto(t, &self.down, active, residual, batch)
    }
}

/// Width of a model and of what its heads share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Widths {
    /// The model's.
    pub dim: usize,
    /// Heads times the width of a head.
    pub inner: usize,
    /// The feed-forward's.
    pub hidden: usize,
}

/// Self-attention, onto a residual.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SelfAttention {
    qkv: Linear,
    out: Linear,
}

impl SelfAttention {
    pub fn new(make: &mut Maker, name: &str, widths: Widths) -> Self {
        let Widths { dim, inner, .. } = widths;
        Self {
            qkv: Linear::new(make, &format!("{name}.qkv"), dim, 3 * inner),
            out: Linear::new(make, &format!("{name}.out"), inner, dim),
        }
    }

    pub fn onto(
        &self,
        t: &mut Tape,
        x: Value,
        residual: Value,
        (sight, batch): (&Sight, &Batch),
        drop: &mut Dropout,
    ) -> Value {
        let packed = self.qkv.forward(t, x);
        let mixed = t.attention(Heads::Own(packed), sight, batch);
        drop.onto(t, &self.out, mixed, residual, batch)
    }
}

/// Cross-attention: queries from the motion, keys and values from the music.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrossAttention {
    q: Linear,
    kv: Linear,
    out: Linear,
}

impl CrossAttention {
    pub fn new(make: &mut Maker, name: &str, widths: Widths) -> Self {
        let Widths { dim, inner, .. } = widths;
        Self {
            q: Linear::new(make, &format!("{name}.q"), dim, inner),
            kv: Linear::new(make, &format!("{name}.kv"), dim, 2 * inner),
            out: Linear::new(make, &format!("{name}.out"), inner, dim),
        }
    }

    pub fn onto(
        &self,
        t: &mut Tape,
        (x, music): (Value, Value),
        residual: Value,
        (sight, batch): (&Sight, &Batch),
        drop: &mut Dropout,
    ) -> Value {
        let (queries, memory) = (self.q.forward(t, x), self.kv.forward(t, music));
        let mixed = t.attention(Heads::Cross(queries, memory), sight, batch);
        drop.onto(t, &self.out, mixed, residual, batch)
    }
}

/// A pre-norm layer of stage 1: self-attention, then feed-forward.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layer {
    norm1: Norm,
    attention: SelfAttention,
    norm2: Norm,
    feed_forward: FeedForward,
}

impl Layer {
    pub fn new(make: &mut Maker, name: &str, widths: Widths, activation: Activation) -> Self {
        let Widths { dim, hidden, .. } = widths;
        Self {
            norm1: Norm::new(make, &format!("{name}.norm1"), dim),
            attention: SelfAttention::new(make, &format!("{name}.attn"), widths),
            norm2: Norm::new(make, &format!("{name}.norm2"), dim),
            feed_forward: FeedForward::new(make, &format!("{name}.ff"), dim, hidden, activation),
        }
    }

    pub fn forward(
        &self,
        t: &mut Tape,
        x: Value,
        sight: &Sight,
        batch: &Batch,
        drop: &mut Dropout,
    ) -> Value {
        let normal = self.norm1.forward(t, x);
        let x = self.attention.onto(t, normal, x, (sight, batch), drop);
        let normal = self.norm2.forward(t, x);
        self.feed_forward.onto(t, normal, x, batch, drop)
    }
}
