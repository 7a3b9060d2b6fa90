//! The learned parts that both networks are made of, on the tape: the trainable
//! form of what [`servodance_model::engine`] runs, under the same names.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::train::autodiff::ops::{AttentionInputs, AttentionMask};
use crate::train::autodiff::parameters::{ParamId, ParamInit, Parameters};
use crate::train::autodiff::tape::{Batch, Tape, Var};
use servodance_model::config::Activation;

/// Makes parameters: where they go and where their first numbers come from.
pub(crate) struct ParamBuilder<'a> {
    pub parameters: &'a mut Parameters,
    pub rng: &'a mut ChaCha8Rng,
}

impl ParamBuilder<'_> {
    pub fn tensor(&mut self, name: String, shape: &[usize], init: ParamInit) -> ParamId {
        self.parameters.add(name, shape, init, false, self.rng)
    }

    fn matrix(&mut self, name: String, shape: &[usize], init: ParamInit) -> ParamId {
        self.parameters.add(name, shape, init, true, self.rng)
    }
}

/// Drops whole channels of a sequence at random, the same at every frame.
#[derive(Debug)]
pub(crate) struct Dropout<'a> {
    pub rate: f32,
    pub rng: &'a mut ChaCha8Rng,
}

impl Dropout<'_> {
    /// `residual + drop(x W^T + b)`.
    fn onto(
        &mut self,
        t: &mut Tape,
        linear: &LinearLayer,
        x: Var,
        residual: Var,
        batch: &Batch,
    ) -> Var {
        if self.rate == 0.0 {
            return linear.onto(t, x, residual);
        }
        let made = linear.forward(t, x);
        let kept = 1.0 / (1.0 - self.rate);
        let channels = t.columns(made) * batch.lengths.len();
        let keep = (0..channels)
            .map(|_| if self.rng.random::<f32>() < self.rate { 0.0 } else { kept })
            .collect();
        let dropped = t.dropout(made, batch.length, keep);
        t.add(residual, dropped)
    }
}

/// `x W^T + b`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinearLayer {
    weight: ParamId,
    bias: ParamId,
}

impl LinearLayer {
    /// Uniform within one over the square root of the inputs, as in PyTorch.
    pub fn new(make: &mut ParamBuilder, name: &str, inputs: usize, outputs: usize) -> Self {
        let init = ParamInit::Uniform((inputs as f32).powf(-0.5));
        Self::begun(make, name, inputs, outputs, init)
    }

    pub fn begun(
        make: &mut ParamBuilder,
        name: &str,
        inputs: usize,
        outputs: usize,
        init: ParamInit,
    ) -> Self {
        Self {
            weight: make.matrix(format!("{name}.weight"), &[outputs, inputs], init),
            bias: make.tensor(format!("{name}.bias"), &[outputs], init),
        }
    }

    pub fn forward(&self, t: &mut Tape, x: Var) -> Var {
        t.affine(x, self.weight, self.bias, None)
    }

    pub fn onto(&self, t: &mut Tape, x: Var, residual: Var) -> Var {
        t.affine(x, self.weight, self.bias, Some(residual))
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct LayerNorm {
    weight: ParamId,
    bias: ParamId,
}

impl LayerNorm {
    pub fn new(make: &mut ParamBuilder, name: &str, dim: usize) -> Self {
        Self {
            weight: make.tensor(format!("{name}.weight"), &[dim], ParamInit::Constant(1.0)),
            bias: make.tensor(format!("{name}.bias"), &[dim], ParamInit::Constant(0.0)),
        }
    }

    pub fn forward(&self, t: &mut Tape, x: Var) -> Var {
        t.layer_norm(x, self.weight, self.bias)
    }
}

/// Two linear layers with an activation between them, onto a residual.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FeedForwardLayer {
    up: LinearLayer,
    down: LinearLayer,
    activation: Activation,
}

impl FeedForwardLayer {
    pub fn new(
        make: &mut ParamBuilder,
        name: &str,
        dim: usize,
        hidden: usize,
        activation: Activation,
    ) -> Self {
        Self {
            up: LinearLayer::new(make, &format!("{name}.up"), dim, hidden),
            down: LinearLayer::new(make, &format!("{name}.down"), hidden, dim),
            activation,
        }
    }

    pub fn onto(
        &self,
        t: &mut Tape,
        x: Var,
        residual: Var,
        batch: &Batch,
        drop: &mut Dropout,
    ) -> Var {
        let wide = self.up.forward(t, x);
        let active = t.activate(wide, self.activation);
        drop.onto(t, &self.down, active, residual, batch)
    }
}

/// Width of a model and of what its heads share.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LayerWidths {
    pub dim: usize,
    pub inner: usize,
    pub hidden: usize,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct SelfAttentionLayer {
    qkv: LinearLayer,
    out: LinearLayer,
}

impl SelfAttentionLayer {
    pub fn new(make: &mut ParamBuilder, name: &str, widths: LayerWidths) -> Self {
        let LayerWidths { dim, inner, .. } = widths;
        Self {
            qkv: LinearLayer::new(make, &format!("{name}.qkv"), dim, 3 * inner),
            out: LinearLayer::new(make, &format!("{name}.out"), inner, dim),
        }
    }

    pub fn onto(
        &self,
        t: &mut Tape,
        x: Var,
        residual: Var,
        (mask, batch): (&AttentionMask, &Batch),
        drop: &mut Dropout,
    ) -> Var {
        let packed = self.qkv.forward(t, x);
        let mixed = t.attention(AttentionInputs::Own(packed), mask, batch);
        drop.onto(t, &self.out, mixed, residual, batch)
    }
}

/// Cross-attention: queries from the motion, keys and values from the music.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrossAttentionLayer {
    q: LinearLayer,
    kv: LinearLayer,
    out: LinearLayer,
}

impl CrossAttentionLayer {
    pub fn new(make: &mut ParamBuilder, name: &str, widths: LayerWidths) -> Self {
        let LayerWidths { dim, inner, .. } = widths;
        Self {
            q: LinearLayer::new(make, &format!("{name}.q"), dim, inner),
            kv: LinearLayer::new(make, &format!("{name}.kv"), dim, 2 * inner),
            out: LinearLayer::new(make, &format!("{name}.out"), inner, dim),
        }
    }

    pub fn onto(
        &self,
        t: &mut Tape,
        (x, music): (Var, Var),
        residual: Var,
        (mask, batch): (&AttentionMask, &Batch),
        drop: &mut Dropout,
    ) -> Var {
        let (queries, memory) = (self.q.forward(t, x), self.kv.forward(t, music));
        let mixed = t.attention(AttentionInputs::Cross(queries, memory), mask, batch);
        drop.onto(t, &self.out, mixed, residual, batch)
    }
}

/// A pre-norm layer of the VQ-VAE: self-attention, then feed-forward.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TransformerLayer {
    norm1: LayerNorm,
    attention: SelfAttentionLayer,
    norm2: LayerNorm,
    feed_forward: FeedForwardLayer,
}

impl TransformerLayer {
    pub fn new(
        make: &mut ParamBuilder,
        name: &str,
        widths: LayerWidths,
        activation: Activation,
    ) -> Self {
        let LayerWidths { dim, hidden, .. } = widths;
        Self {
            norm1: LayerNorm::new(make, &format!("{name}.norm1"), dim),
            attention: SelfAttentionLayer::new(make, &format!("{name}.attn"), widths),
            norm2: LayerNorm::new(make, &format!("{name}.norm2"), dim),
            feed_forward: FeedForwardLayer::new(
                make,
                &format!("{name}.ff"),
                dim,
                hidden,
                activation,
            ),
        }
    }

    pub fn forward(
        &self,
        t: &mut Tape,
        x: Var,
        mask: &AttentionMask,
        batch: &Batch,
        drop: &mut Dropout,
    ) -> Var {
        let normal = self.norm1.forward(t, x);
        let x = self.attention.onto(t, normal, x, (mask, batch), drop);
        let normal = self.norm2.forward(t, x);
        self.feed_forward.onto(t, normal, x, batch, drop)
    }
}
