//! What happens to each number or row by itself: activation, sum, dropout, the
//! style modulation, parts side by side.

use rayon::prelude::*;

use super::PIECE_ROWS;
use crate::train::autodiff::lanes;
use crate::train::autodiff::tape::{Gradients, Operation, Tape, Var};
use servodance_model::config::Activation;

/// sqrt(2 / pi) and the cubic term of GELU's tanh form.
const GELU: (f32, f32) = (0.797_884_6, 0.044_715);

fn tanh(x: f32) -> f32 {
    1.0 - 2.0 / (lanes::exp(2.0 * x) + 1.0)
}

struct Activate {
    x: Var,
    kind: Activation,
}

struct Add {
    a: Var,
    b: Var,
}

struct DropoutStep {
    x: Var,
    length: usize,
    /// What each channel of each sequence is multiplied by.
    keep: Vec<f32>,
}

struct Modulate {
    x: Var,
    scale: Var,
    length: usize,
}

struct Beside {
    parts: Vec<Var>,
}

impl Tape<'_> {
    pub fn activate(&mut self, x: Var, kind: Activation) -> Var {
        let columns = self.columns(x);
        let mut out = self.buffers.take(self.data(x).len());
        let of = |x: f32| match kind {
            Activation::Gelu => 0.5 * x * (1.0 + tanh(GELU.0 * (x + GELU.1 * x * x * x))),
            Activation::Relu2 => x.max(0.0) * x.max(0.0),
        };
        let chunk = PIECE_ROWS * columns;
        out.par_chunks_mut(chunk)
            .zip(self.data(x).par_chunks(chunk))
            .for_each(|(out, x)| out.iter_mut().zip(x).for_each(|(o, x)| *o = of(*x)));
        self.record(out, columns, Activate { x, kind })
    }

    pub fn add(&mut self, a: Var, b: Var) -> Var {
        let mut out = self.buffers.take(self.data(a).len());
        for ((out, a), b) in out.iter_mut().zip(self.data(a)).zip(self.data(b)) {
            *out = a + b;
        }
        self.record(out, self.columns(a), Add { a, b })
    }

    /// Channel c of sequence s times `keep[s * columns + c]`, the same at all its frames.
    pub fn dropout(&mut self, x: Var, length: usize, keep: Vec<f32>) -> Var {
        let mut out = self.buffers.take(self.data(x).len());
        out.copy_from_slice(self.data(x));
        let columns = self.columns(x);
        keep_channels(&mut out, length * columns, columns, &keep);
        self.record(out, columns, DropoutStep { x, length, keep })
    }

    /// Eq. 5 as a residual branch: `x + scale * x / |x| * sqrt(columns)`, with
    /// one row of `scale` a sequence of `length` frames.
    pub fn modulate(&mut self, x: Var, scale: Var, length: usize) -> Var {
        let columns = self.columns(x);
        let mut out = self.buffers.take(self.data(x).len());
        let scales = self.data(scale);
        out.par_chunks_mut(columns).zip(self.data(x).par_chunks(columns)).enumerate().for_each(
            |(r, (out, x))| {
                let scale = &scales[r / length * columns..][..columns];
                let unit = unit(x);
                for i in 0..columns {
                    out[i] = x[i] + scale[i] * x[i] * unit;
                }
            },
        );
        self.record(out, columns, Modulate { x, scale, length })
    }

    /// The columns of all parts side by side.
    pub fn beside(&mut self, parts: &[Var]) -> Var {
        let columns: usize = parts.iter().map(|part| self.columns(*part)).sum();
        let rows = self.data(parts[0]).len() / self.columns(parts[0]);
        let mut out = Vec::with_capacity(rows * columns);
        for r in 0..rows {
            for part in parts {
                let wide = self.columns(*part);
                out.extend_from_slice(&self.data(*part)[r * wide..][..wide]);
            }
        }
        self.straight_through(parts, out)
    }

    /// `replacement` [rows, columns of all parts] as the value, the gradient of the parts.
    pub fn straight_through(&mut self, parts: &[Var], replacement: Vec<f32>) -> Var {
        let columns = parts.iter().map(|part| self.columns(*part)).sum();
        let parts = parts.to_vec();
        self.record(replacement, columns, Beside { parts })
    }
}

/// What makes a row as long as the square root of its width; the epsilon is that of `net`.
fn unit(x: &[f32]) -> f32 {
    (x.len() as f32).sqrt() / (lanes::dot(x, x) + 1e-6).sqrt()
}

fn keep_channels(x: &mut [f32], sequence: usize, columns: usize, keep: &[f32]) {
    for (frames, keep) in x.chunks_mut(sequence).zip(keep.chunks(columns)) {
        for row in frames.chunks_mut(columns) {
            row.iter_mut().zip(keep).for_each(|(x, keep)| *x *= keep);
        }
    }
}

impl Operation for Activate {
    fn backward(&self, tape: &Tape, _: Var, mut gradient: Vec<f32>, into: &mut Gradients) {
        let slope = |x: f32| match self.kind {
            Activation::Gelu => {
                let t = tanh(GELU.0 * (x + GELU.1 * x * x * x));
                let inner = GELU.0 * (1.0 + 3.0 * GELU.1 * x * x);
                0.5 * (1.0 + t) + 0.5 * x * (1.0 - t * t) * inner
            }
            Activation::Relu2 => 2.0 * x.max(0.0),
        };
        let chunk = PIECE_ROWS * tape.columns(self.x);
        gradient
            .par_chunks_mut(chunk)
            .zip(tape.data(self.x).par_chunks(chunk))
            .for_each(|(g, x)| g.iter_mut().zip(x).for_each(|(g, x)| *g *= slope(*x)));
        into.add(self.x, gradient);
    }
}

impl Operation for Add {
    fn backward(&self, tape: &Tape, _: Var, gradient: Vec<f32>, into: &mut Gradients) {
        if tape.learns(self.a) && tape.learns(self.b) {
            let mut copy = into.buffers.take(gradient.len());
            copy.copy_from_slice(&gradient);
            into.add(self.a, copy);
            into.add(self.b, gradient);
        } else if tape.learns(self.a) {
            into.add(self.a, gradient);
        } else {
            into.add(self.b, gradient);
        }
    }
}

impl Operation for DropoutStep {
    fn backward(&self, tape: &Tape, _: Var, mut gradient: Vec<f32>, into: &mut Gradients) {
        let columns = tape.columns(self.x);
        keep_channels(&mut gradient, self.length * columns, columns, &self.keep);
        into.add(self.x, gradient);
    }
}

impl Operation for Modulate {
    fn backward(&self, tape: &Tape, _: Var, mut gradient: Vec<f32>, into: &mut Gradients) {
        let columns = tape.columns(self.x);
        let (x, scales) = (tape.data(self.x), tape.data(self.scale));
        let mut d_scale = into.buffers.zeros(scales.len());
        let sequence = self.length * columns;
        // A sequence at a time: its frames share a row of the scale.
        d_scale
            .par_chunks_mut(columns)
            .zip(gradient.par_chunks_mut(sequence))
            .zip(x.par_chunks(sequence).zip(scales.par_chunks(columns)))
            .for_each(|((d_scale, g), (x, scale))| {
                let mut pull = vec![0.0; columns];
                for (g, x) in g.chunks_mut(columns).zip(x.chunks(columns)) {
                    let unit = unit(x);
                    for i in 0..columns {
                        d_scale[i] += g[i] * x[i] * unit;
                        pull[i] = g[i] * scale[i];
                    }
                    let along = lanes::dot(&pull, x) * unit * unit / columns as f32;
                    for i in 0..columns {
                        g[i] += unit * (pull[i] - x[i] * along);
                    }
                }
            });
        into.add(self.scale, d_scale);
        into.add(self.x, gradient);
    }
}

impl Operation for Beside {
    fn backward(&self, tape: &Tape, this: Var, gradient: Vec<f32>, into: &mut Gradients) {
        let (columns, mut from) = (tape.columns(this), 0);
        for part in &self.parts {
            let wide = tape.columns(*part);
            let mut share = into.buffers.take(gradient.len() / columns * wide);
            for (share, row) in share.chunks_mut(wide).zip(gradient.chunks(columns)) {
                share.copy_from_slice(&row[from..from + wide]);
            }
            into.add(*part, share);
            from += wide;
        }
        into.buffers.give(gradient);
    }
}
