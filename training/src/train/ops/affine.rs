//! `x W^T + b`, alone or onto a residual.

use rayon::prelude::*;

use super::{PIECE_ROWS, sum_over_rows};
use crate::train::lanes;
use crate::train::parameters::Id;
use crate::train::product::{Onto, Threads, View, ViewMut, product};
use crate::train::tape::{Gradients, Operation, Tape, Value};

struct Affine {
    x: Value,
    weight: Id,
    bias: Id,
    residual: Option<Value>,
}

impl Tape<'_> {
    /// `x W^T + b`, W of [outputs, inputs]; plus `residual` if there is one.
    pub fn affine(&mut self, x: Value, weight: Id, bias: Id, residual: Option<Value>) -> Value {
        let (outputs, inputs) = (self.parameters.get(bias).len(), self.columns(x));
        let rows = self.data(x).len() / inputs;
        let mut out = self.buffers.take(rows * outputs);
        let b = self.parameters.get(bias);
        let before = residual.map(|value| self.data(value));
        out.par_chunks_mut(PIECE_ROWS * outputs)
            .enumerate()
            .for_each(|(piece, chunk)| {
                for (r, row) in chunk.chunks_mut(outputs).enumerate() {
                    row.copy_from_slice(b);
                    if let Some(before) = before {
                        lanes::add(
                            row,
                            &before[(piece * PIECE_ROWS + r) * outputs..][..outputs],
                        );
                    }
                }
            });
        let w = View::of(self.parameters.get(weight), outputs, inputs).t();
        let x_view = View::of(self.data(x), rows, inputs);
        let to = ViewMut::of(&mut out, rows, outputs);
        product(to, Onto::Sum, x_view, w, Threads::All);
        let by = Affine {
            x,
            weight,
            bias,
            residual,
        };
        self.record(out, outputs, by)
    }
}

impl Operation for Affine {
    fn backward(&self, tape: &Tape, this: Value, gradient: Vec<f32>, into: &mut Gradients) {
        let (outputs, inputs) = (tape.columns(this), tape.columns(self.x));
        let rows = gradient.len() / outputs;
        let g = View::of(&gradient, rows, outputs);
        let x = View::of(tape.data(self.x), rows, inputs);
        let dw = ViewMut::of(into.parameters.of(self.weight), outputs, inputs);
        product(dw, Onto::Sum, g.t(), x, Threads::All);
        sum_over_rows(into.parameters.of(self.bias), rows, |piece, sums| {
            for r in piece {
                lanes::add(sums, &gradient[r * outputs..][..outputs]);
            }
        });
        if tape.learns(self.x) {
            let (mut dx, onto) = match into.take(self.x) {
                Some(sum) => (sum, Onto::Sum),
                None => (into.buffers.take(rows * inputs), Onto::Nothing),
            };
            let w = View::of(tape.parameters.get(self.weight), outputs, inputs);
            product(ViewMut::of(&mut dx, rows, inputs), onto, g, w, Threads::All);
            into.add(self.x, dx);
        }
        match self.residual {
            Some(residual) if tape.learns(residual) => into.add(residual, gradient),
            _ => into.buffers.give(gradient),
        }
    }
}
