//! Layer norm with scale and shift.

use rayon::prelude::*;

use super::{PIECE_ROWS, sum_over_rows};
use crate::train::autodiff::lanes;
use crate::train::autodiff::parameters::ParamId;
use crate::train::autodiff::tape::{Gradients, Operation, Tape, Var};

/// PyTorch's default, as in `net`.
const EPSILON: f32 = 1e-5;

struct LayerNormStep {
    x: Var,
    weight: ParamId,
    bias: ParamId,
}

/// Mean of a row and one over its standard deviation.
fn statistics(row: &[f32]) -> (f32, f32) {
    let n = row.len() as f32;
    let mean = lanes::sum(row) / n;
    let mut squares = 0.0;
    let mut apart = [0.0; 8];
    let (chunks, rest) = row.as_chunks::<8>();
    for chunk in chunks {
        for (a, v) in apart.iter_mut().zip(chunk) {
            *a += (v - mean) * (v - mean);
        }
    }
    for v in rest {
        squares += (v - mean) * (v - mean);
    }
    let variance = (squares + lanes::sum(&apart)) / n;
    (mean, 1.0 / (variance + EPSILON).sqrt())
}

impl Tape<'_> {
    /// Every row to mean 0 and deviation 1, then scaled and shifted.
    pub fn layer_norm(&mut self, x: Var, weight: ParamId, bias: ParamId) -> Var {
        let columns = self.columns(x);
        let mut out = self.buffers.take(self.data(x).len());
        let (w, b) = (self.parameters.get(weight), self.parameters.get(bias));
        out.par_chunks_mut(PIECE_ROWS * columns)
            .zip(self.data(x).par_chunks(PIECE_ROWS * columns))
            .for_each(|(out, x)| {
                for (out, x) in out.chunks_mut(columns).zip(x.chunks(columns)) {
                    let (mean, scale) = statistics(x);
                    for i in 0..columns {
                        out[i] = (x[i] - mean) * scale * w[i] + b[i];
                    }
                }
            });
        self.record(out, columns, LayerNormStep { x, weight, bias })
    }
}

impl Operation for LayerNormStep {
    fn backward(&self, tape: &Tape, _: Var, gradient: Vec<f32>, into: &mut Gradients) {
        let columns = tape.columns(self.x);
        let (x, w) = (tape.data(self.x), tape.parameters.get(self.weight));
        let mut sums = vec![0.0; 2 * columns];
        sum_over_rows(&mut sums, x.len() / columns, |piece, sums| {
            let (dw, db) = sums.split_at_mut(columns);
            for r in piece {
                let (x, g) = (&x[r * columns..][..columns], &gradient[r * columns..][..columns]);
                let (mean, scale) = statistics(x);
                for i in 0..columns {
                    dw[i] += g[i] * (x[i] - mean) * scale;
                    db[i] += g[i];
                }
            }
        });
        lanes::add(into.parameters.of(self.weight), &sums[..columns]);
        lanes::add(into.parameters.of(self.bias), &sums[columns..]);
        if !tape.learns(self.x) {
            return into.buffers.give(gradient);
        }
        let mut dx = gradient;
        dx.par_chunks_mut(PIECE_ROWS * columns).zip(x.par_chunks(PIECE_ROWS * columns)).for_each(
            |(dx, x)| {
                let mut unit = vec![0.0; columns];
                for (dx, x) in dx.chunks_mut(columns).zip(x.chunks(columns)) {
                    let (mean, scale) = statistics(x);
                    for i in 0..columns {
                        unit[i] = (x[i] - mean) * scale;
                        dx[i] *= w[i];
                    }
                    let n = columns as f32;
                    let (even, along) = (lanes::sum(dx) / n, lanes::dot(dx, &unit) / n);
                    for i in 0..columns {
                        dx[i] = scale * (dx[i] - even - unit[i] * along);
                    }
                }
            },
        );
        into.add(self.x, dx);
    }
}
