//! `x W^T + b`, alone or onto a residual.

use rayon::prelude::*;

use super::{PIECE_ROWS, sum_over_rows};
use crate::train::autodiff::lanes;
use crate::train::autodiff::matmul::{MatrixView, MatrixViewMut, Threads, WriteMode, product};
use crate::train::autodiff::parameters::ParamId;
use crate::train::autodiff::tape::{Gradients, Operation, Tape, Var};

struct Affine {
    x: Var,
    weight: ParamId,
    bias: ParamId,
    residual: Option<Var>,
}

impl Tape<'_> {
    /// `x W^T + b`, W of [outputs, inputs]; plus `residual` if there is one.
    pub fn affine(&mut self, x: Var, weight: ParamId, bias: ParamId, residual: Option<Var>) -> Var {
        let (outputs, inputs) = (self.parameters.get(bias).len(), self.columns(x));
        let rows = self.data(x).len() / inputs;
        let mut out = self.buffers.take(rows * outputs);
        let b = self.parameters.get(bias);
        let before = residual.map(|value| self.data(value));
        out.par_chunks_mut(PIECE_ROWS * outputs).enumerate().for_each(|(piece, chunk)| {
            for (r, row) in chunk.chunks_mut(outputs).enumerate() {
                row.copy_from_slice(b);
                if let Some(before) = before {
                    lanes::add(row, &before[(piece * PIECE_ROWS + r) * outputs..][..outputs]);
                }
            }
        });
        let w = MatrixView::of(self.parameters.get(weight), outputs, inputs).t();
        let x_view = MatrixView::of(self.data(x), rows, inputs);
        let to = MatrixViewMut::of(&mut out, rows, outputs);
        product(to, WriteMode::Sum, x_view, w, Threads::All);
        let by = Affine { x, weight, bias, residual };
        self.record(out, outputs, by)
    }
}

impl Operation for Affine {
    fn backward(&self, tape: &Tape, this: Var, gradient: Vec<f32>, into: &mut Gradients) {
        let (outputs, inputs) = (tape.columns(this), tape.columns(self.x));
        let rows = gradient.len() / outputs;
        let g = MatrixView::of(&gradient, rows, outputs);
        let x = MatrixView::of(tape.data(self.x), rows, inputs);
        let dw = MatrixViewMut::of(into.parameters.of(self.weight), outputs, inputs);
        product(dw, WriteMode::Sum, g.t(), x, Threads::All);
        sum_over_rows(into.parameters.of(self.bias), rows, |piece, sums| {
            for r in piece {
                lanes::add(sums, &gradient[r * outputs..][..outputs]);
            }
        });
        if tape.learns(self.x) {
            let (mut dx, onto) = match into.take(self.x) {
                Some(sum) => (sum, WriteMode::Sum),
                None => (into.buffers.take(rows * inputs), WriteMode::Nothing),
            };
            let w = MatrixView::of(tape.parameters.get(self.weight), outputs, inputs);
            product(MatrixViewMut::of(&mut dx, rows, inputs), onto, g, w, Threads::All);
            into.add(self.x, dx);
        }
        match self.residual {
            Some(residual) if tape.learns(residual) => into.add(residual, gradient),
            _ => into.buffers.give(gradient),
        }
    }
}
