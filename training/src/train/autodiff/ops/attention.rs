//! Attention with ALiBi over a batch: queries, keys and values lie side by side
//! in the rows of one or two values.
//!
//! Blocks of queries are multiplied with the keys that they can see and no
//! others, so the window saves its share of the work. Going back, the weights
//! are made again from the logarithm of their sum, which is all that is kept.
//! Padding is neither seen nor sees.

use std::ops::Range;

use rayon::prelude::*;

use crate::train::autodiff::lanes;
use crate::train::autodiff::matmul::{MatrixView, MatrixViewMut, Threads, WriteMode, product};
use crate::train::autodiff::tape::{Batch, Gradients, Operation, Tape, Var};

const BLOCK: usize = 48;

/// Which frames a frame sees, and how the bias falls with distance:
/// `-slope * |i - j|` for `i - window < j <= i + ahead`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AttentionMask {
    pub slopes: Vec<f32>,
    pub window: usize,
    pub ahead: usize,
}

impl AttentionMask {
    pub fn everything(heads: usize) -> Self {
        Self { slopes: vec![0.0; heads], window: usize::MAX / 2, ahead: usize::MAX / 2 }
    }

    /// What frame `i` of `length` sees.
    pub(super) fn of(&self, i: usize, length: usize) -> Range<usize> {
        let end = length.min(i + self.ahead + 1);
        (i + 1).saturating_sub(self.window).min(end)..end
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum AttentionInputs {
    Own(Var),
    /// Queries in the first, keys and values in the second.
    Cross(Var, Var),
}

struct Attention {
    heads: AttentionInputs,
    mask: AttentionMask,
    batch: Batch,
    /// Logarithm of the sum of each row of weights, [sequence, head, frame].
    log_sums: Vec<f32>,
}

/// Columns of one row: the values that hold queries and keys, and their widths.
#[derive(Clone, Copy)]
struct HeadColumns {
    queries: Var,
    memory: Var,
    dim: usize,
    width: usize,
    stride: [usize; 2],
    /// Where keys begin in a row of the memory; values lie `dim` further.
    keys_at: usize,
}

impl HeadColumns {
    fn of(tape: &Tape, heads: AttentionInputs, count: usize) -> Self {
        let (queries, memory, dim, keys_at) = match heads {
            AttentionInputs::Own(packed) => {
                (packed, packed, tape.columns(packed) / 3, tape.columns(packed) / 3)
            }
            AttentionInputs::Cross(queries, memory) => (queries, memory, tape.columns(queries), 0),
        };
        Self {
            queries,
            memory,
            dim,
            width: dim / count,
            stride: [tape.columns(queries), tape.columns(memory)],
            keys_at,
        }
    }

    /// 1 / sqrt of a head's width.
    fn scale(&self) -> f32 {
        (self.width as f32).powf(-0.5)
    }
}

/// One head of one sequence: rows of queries, keys and values.
struct AttentionHead<'a> {
    columns: &'a HeadColumns,
    queries: &'a [f32],
    memory: &'a [f32],
    mask: &'a AttentionMask,
    head: usize,
    real: usize,
}

impl AttentionHead<'_> {
    fn rows<'b>(
        data: &'b [f32],
        stride: usize,
        at: usize,
        rows: Range<usize>,
        width: usize,
    ) -> MatrixView<'b> {
        MatrixView::strided(&data[rows.start * stride + at..], rows.len(), width, stride)
    }

    fn query(&self, rows: Range<usize>) -> MatrixView<'_> {
        let c = self.columns;
        Self::rows(self.queries, c.stride[0], self.head * c.width, rows, c.width)
    }

    fn key(&self, rows: Range<usize>) -> MatrixView<'_> {
        let c = self.columns;
        let at = c.keys_at + self.head * c.width;
        Self::rows(self.memory, c.stride[1], at, rows, c.width)
    }

    fn value(&self, rows: Range<usize>) -> MatrixView<'_> {
        let c = self.columns;
        let at = c.keys_at + c.dim + self.head * c.width;
        Self::rows(self.memory, c.stride[1], at, rows, c.width)
    }

    /// Blocks of queries, each with all keys that one of them sees.
    fn blocks(&self) -> impl Iterator<Item = (Range<usize>, Range<usize>)> + '_ {
        (0..self.real).step_by(BLOCK).map(|first| {
            let end = self.real.min(first + BLOCK);
            let low = self.mask.of(first, self.real).start;
            (first..end, low..self.mask.of(end - 1, self.real).end)
        })
    }

    /// Scaled and biased scores of a block, into `out` [queries, keys].
    fn scores(&self, out: &mut [f32], queries: &Range<usize>, keys: &Range<usize>) {
        let to = MatrixViewMut::of(out, queries.len(), keys.len());
        let (q, k) = (self.query(queries.clone()), self.key(keys.clone()).t());
        product(to, WriteMode::Nothing, q, k, Threads::One);
        let (scale, slope) = (self.columns.scale(), self.mask.slopes[self.head]);
        for (i, row) in queries.clone().zip(out.chunks_mut(keys.len())) {
            let ahead = keys.start as f32 - i as f32;
            for (at, score) in row.iter_mut().enumerate() {
                *score = *score * scale - slope * (ahead + at as f32).abs();
            }
        }
    }

    /// What query `i` sees, counted from the first key of its block.
    fn seen(&self, i: usize, keys: &Range<usize>) -> Range<usize> {
        let seen = self.mask.of(i, self.real);
        seen.start - keys.start..seen.end - keys.start
    }
}

impl Tape<'_> {
    /// Softmax attention, [rows, dim].
    pub fn attention(
        &mut self,
        heads: AttentionInputs,
        mask: &AttentionMask,
        batch: &Batch,
    ) -> Var {
        let columns = HeadColumns::of(self, heads, mask.slopes.len());
        let (length, dim) = (batch.length, columns.dim);
        let mut out = self.buffers.zeros(batch.rows() * dim);
        let mut log_sums = self.buffers.zeros(batch.rows() * mask.slopes.len());
        let (queries, memory) = (self.data(columns.queries), self.data(columns.memory));
        out.par_chunks_mut(length * dim)
            .zip(log_sums.par_chunks_mut(length * mask.slopes.len()))
            .zip(queries.par_chunks(length * columns.stride[0]))
            .zip(memory.par_chunks(length * columns.stride[1]))
            .zip(&batch.lengths)
            .for_each(|((((out, log_sums), queries), memory), &real)| {
                for (head, log_sums) in log_sums.chunks_mut(length).enumerate() {
                    let head =
                        AttentionHead { columns: &columns, queries, memory, mask, head, real };
                    mix(&head, out, log_sums);
                }
            });
        let by = Attention { heads, mask: mask.clone(), batch: batch.clone(), log_sums };
        self.record(out, dim, by)
    }
}

/// One head forward: its columns of `out` and the logarithms of its sums.
fn mix(head: &AttentionHead, out: &mut [f32], log_sums: &mut [f32]) {
    let (dim, width) = (head.columns.dim, head.columns.width);
    let mut scratch = Vec::new();
    for (queries, keys) in head.blocks() {
        scratch.resize(queries.len() * keys.len(), 0.0);
        head.scores(&mut scratch, &queries, &keys);
        for (i, row) in queries.clone().zip(scratch.chunks_mut(keys.len())) {
            let seen = head.seen(i, &keys);
            let largest = lanes::max(&row[seen.clone()]);
            row[..seen.start].fill(0.0);
            row[seen.end..].fill(0.0);
            let row = &mut row[seen];
            row.iter_mut().for_each(|s| *s = lanes::exp(*s - largest));
            let sum = lanes::sum(row);
            row.iter_mut().for_each(|s| *s /= sum);
            log_sums[i] = largest + sum.ln();
        }
        let weights = MatrixView::of(&scratch, queries.len(), keys.len());
        let at = queries.start * dim + head.head * width;
        let to = MatrixViewMut::strided(&mut out[at..], queries.len(), width, dim);
        product(to, WriteMode::Nothing, weights, head.value(keys), Threads::One);
    }
}

impl Operation for Attention {
    fn backward(&self, tape: &Tape, this: Var, gradient: Vec<f32>, into: &mut Gradients) {
        let columns = HeadColumns::of(tape, self.heads, self.mask.slopes.len());
        let (length, dim) = (self.batch.length, columns.dim);
        let own = columns.queries == columns.memory;
        let [queries, memory] = [columns.queries, columns.memory].map(|value| tape.data(value));
        // Keys and values in the second, with the queries if they are there.
        let mut d_queries = into.buffers.zeros(if own { 0 } else { queries.len() });
        let mut d_memory = into.buffers.zeros(memory.len());
        let wide = if own { 1 } else { length * columns.stride[0] };
        let mut empty = vec![0.0; if own { self.batch.lengths.len() } else { 0 }];
        let d_queries_or_none = if own { &mut empty } else { &mut d_queries };
        let by_length = |columns: usize| length * columns;
        d_memory
            .par_chunks_mut(by_length(columns.stride[1]))
            .zip(d_queries_or_none.par_chunks_mut(wide))
            .zip(queries.par_chunks(by_length(columns.stride[0])))
            .zip(memory.par_chunks(by_length(columns.stride[1])))
            .zip(tape.data(this).par_chunks(by_length(dim)))
            .zip(gradient.par_chunks(by_length(dim)))
            .zip(self.log_sums.par_chunks(by_length(self.mask.slopes.len())))
            .zip(&self.batch.lengths)
            .for_each(
                |(((((((d_memory, d_queries), queries), memory), out), g), log_sums), &real)| {
                    let mut back = HeadGradients::new(length, columns.width);
                    for (head, log_sums) in log_sums.chunks(length).enumerate() {
                        let head = AttentionHead {
                            columns: &columns,
                            queries,
                            memory,
                            mask: &self.mask,
                            head,
                            real,
                        };
                        back.unmix(&head, out, g, log_sums);
                        let at = head.head * columns.width;
                        let keys = columns.keys_at + at;
                        let stride = columns.stride;
                        match own {
                            true => back.put(&back.d_query, d_memory, stride[1], at),
                            false => back.put(&back.d_query, d_queries, stride[0], at),
                        }
                        back.put(&back.d_key, d_memory, stride[1], keys);
                        back.put(&back.d_value, d_memory, stride[1], keys + dim);
                    }
                },
            );
        into.buffers.give(gradient);
        if !own {
            into.add(columns.queries, d_queries);
        }
        into.add(columns.memory, d_memory);
    }
}

/// Gradients of one head of one sequence, [frames, width] each.
struct HeadGradients {
    width: usize,
    d_query: Vec<f32>,
    d_key: Vec<f32>,
    d_value: Vec<f32>,
    weights: Vec<f32>,
    d_scores: Vec<f32>,
}

impl HeadGradients {
    fn new(length: usize, width: usize) -> Self {
        let zeros = || vec![0.0; length * width];
        Self {
            width,
            d_query: zeros(),
            d_key: zeros(),
            d_value: zeros(),
            weights: Vec::new(),
            d_scores: Vec::new(),
        }
    }

    fn unmix(&mut self, head: &AttentionHead, out: &[f32], gradient: &[f32], log_sums: &[f32]) {
        let (dim, width, at) = (head.columns.dim, self.width, head.head * self.width);
        self.d_key.fill(0.0);
        self.d_value.fill(0.0);
        self.d_query.fill(0.0);
        for (queries, keys) in head.blocks() {
            let (m, n) = (queries.len(), keys.len());
            self.weights.resize(m * n, 0.0);
            self.d_scores.resize(m * n, 0.0);
            head.scores(&mut self.weights, &queries, &keys);
            let g = AttentionHead::rows(gradient, dim, at, queries.clone(), width);
            let to = MatrixViewMut::of(&mut self.d_scores, m, n);
            product(to, WriteMode::Nothing, g, head.value(keys.clone()).t(), Threads::One);
            let rows = self.weights.chunks_mut(n).zip(self.d_scores.chunks_mut(n));
            for (i, (weights, d_scores)) in queries.clone().zip(rows) {
                let seen = head.seen(i, &keys);
                for row in [&mut *weights, &mut *d_scores] {
                    row[..seen.start].fill(0.0);
                    row[seen.end..].fill(0.0);
                }
                let (g, out) = (&gradient[i * dim + at..][..width], &out[i * dim + at..][..width]);
                let even = lanes::dot(g, out);
                let scale = head.columns.scale();
                let seen_rows = weights[seen.clone()].iter_mut().zip(&mut d_scores[seen]);
                for (weight, d) in seen_rows {
                    *weight = lanes::exp(*weight - log_sums[i]);
                    *d = *weight * (*d - even) * scale;
                }
            }
            let weights = MatrixView::of(&self.weights, m, n);
            let d_scores = MatrixView::of(&self.d_scores, m, n);
            let part = |rows: &Range<usize>| rows.start * width..rows.end * width;
            let d_value = MatrixViewMut::of(&mut self.d_value[part(&keys)], n, width);
            product(d_value, WriteMode::Sum, weights.t(), g, Threads::One);
            let d_key = MatrixViewMut::of(&mut self.d_key[part(&keys)], n, width);
            product(d_key, WriteMode::Sum, d_scores.t(), head.query(queries.clone()), Threads::One);
            let d_query = MatrixViewMut::of(&mut self.d_query[part(&queries)], m, width);
            product(d_query, WriteMode::Nothing, d_scores, head.key(keys.clone()), Threads::One);
        }
    }

    /// Writes [frames, width] into columns of rows `stride` wide.
    fn put(&self, from: &[f32], to: &mut [f32], stride: usize, at: usize) {
        for (row, from) in to.chunks_mut(stride).zip(from.chunks(self.width)) {
            row[at..at + self.width].copy_from_slice(from);
        }
    }
}
