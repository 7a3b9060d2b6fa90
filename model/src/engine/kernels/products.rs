//! Rows of a matrix times vectors. The order of a row's sum does not depend on
//! the rows around it.

use super::super::lanes::Lanes;
use crate::weights::{BLOCK, CHUNK, CHUNK_WORDS};

/// Numbers whose scales are taken together.
const GROUP: usize = 8 * BLOCK;
/// How far ahead weights are fetched, bytes.
const AHEAD: usize = 2048;

/// Eight numbers of a row: how f32 and f16 rows are read by the same code.
pub(super) trait Stored: Copy {
    fn load<L: Lanes>(values: &[Self; 8]) -> L;
}

impl Stored for f32 {
    #[inline(always)]
    fn load<L: Lanes>(values: &[f32; 8]) -> L {
        L::load(values)
    }
}

impl Stored for u16 {
    #[inline(always)]
    fn load<L: Lanes>(values: &[u16; 8]) -> L {
        L::load_half(values)
    }
}

/// Dot product of widths that 8 divides, in four running sums.
#[inline(always)]
fn dot<L: Lanes, S: Stored>(row: &[S], x: &[f32]) -> f32 {
    let mut sums = [L::splat(0.0); 4];
    let (row, row_rest) = row.as_chunks::<32>();
    let (x, x_rest) = x.as_chunks::<32>();
    for (row, x) in row.iter().zip(x) {
        L::fetch(row, AHEAD);
        let pairs = row.as_chunks::<8>().0.iter().zip(x.as_chunks::<8>().0);
        for (sum, (w, v)) in sums.iter_mut().zip(pairs) {
            *sum = S::load::<L>(w).fma(L::load(v), *sum);
        }
    }
    let rest = row_rest.as_chunks::<8>().0.iter().zip(x_rest.as_chunks::<8>().0);
    for (w, v) in rest {
        sums[0] = S::load::<L>(w).fma(L::load(v), sums[0]);
    }
    (sums[0].add(sums[1])).add(sums[2].add(sums[3])).sum()
}

/// Rows of f32 or f16.
#[inline(always)]
pub(super) fn rows<L: Lanes, S: Stored>(out: &mut [f32], weights: &[S], x: &[f32], width: usize) {
    let lanes = x.len() / width;
    for (out, row) in out.chunks_exact_mut(lanes).zip(weights.chunks_exact(width)) {
        for (out, x) in out.iter_mut().zip(x.chunks_exact(width)) {
            *out = dot::<L, S>(row, x);
        }
    }
}

/// Integers with scales beside them: how rows of every such format are read.
pub(super) trait Quantised: Copy {
    /// Things stored for a row of so many numbers.
    fn stored(width: usize) -> usize;
    /// A row times a vector, each with its scales in groups of 8 blocks.
    fn dot<L: Lanes>(row: &[Self], scales: &[[u16; 8]], x: &[i16], x_scales: &[[f32; 8]]) -> f32;
}

impl Quantised for i8 {
    #[inline(always)]
    fn stored(width: usize) -> usize {
        width
    }

    #[inline(always)]
    fn dot<L: Lanes>(row: &[i8], scales: &[[u16; 8]], x: &[i16], x_scales: &[[f32; 8]]) -> f32 {
        dot_of_blocks::<L, [i8; BLOCK]>(row.as_chunks().0, scales, x.as_chunks().0, x_scales)
    }
}

/// `q4_0`: two numbers a byte.
impl Quantised for u8 {
    #[inline(always)]
    fn stored(width: usize) -> usize {
        width / 2
    }

    #[inline(always)]
    fn dot<L: Lanes>(row: &[u8], scales: &[[u16; 8]], x: &[i16], x_scales: &[[f32; 8]]) -> f32 {
        dot_of_blocks::<L, [u8; BLOCK / 2]>(row.as_chunks().0, scales, x.as_chunks().0, x_scales)
    }
}

/// `q6`: chunks of words.
impl Quantised for u16 {
    #[inline(always)]
    fn stored(width: usize) -> usize {
        width / CHUNK * CHUNK_WORDS
    }

    #[inline(always)]
    fn dot<L: Lanes>(row: &[u16], scales: &[[u16; 8]], x: &[i16], x_scales: &[[f32; 8]]) -> f32 {
        dot_of_chunks::<L>(row.as_chunks().0, scales, x.as_chunks().0, x_scales)
    }
}

/// Rows of integers. One row at a time: memory is read the faster the fewer
/// places it is read from.
#[inline(always)]
pub(super) fn rows_of_integers<L: Lanes, W: Quantised>(
    out: &mut [f32],
    weights: &[W],
    scales: &[u16],
    x: &[i16],
    x_scales: &[f32],
    width: usize,
) {
    let lanes = x.len() / width;
    let scales_width = 8 * width.div_ceil(GROUP);
    let rows = weights.chunks_exact(W::stored(width)).zip(scales.chunks_exact(scales_width));
    for (out, (row, scales)) in out.chunks_exact_mut(lanes).zip(rows) {
        let scales = scales.as_chunks().0;
        let vectors = x.chunks_exact(width).zip(x_scales.chunks_exact(scales_width));
        for (out, (x, x_scales)) in out.iter_mut().zip(vectors) {
            *out = W::dot::<L>(row, scales, x, x_scales.as_chunks().0);
        }
    }
}

/// Numbers that share a scale.
trait Block {
    /// Their products with as many numbers, summed to eight (exact).
    fn dot<L: Lanes>(&self, x: &[i16; BLOCK]) -> L;
}

impl Block for [i8; BLOCK] {
    #[inline(always)]
    fn dot<L: Lanes>(&self, x: &[i16; BLOCK]) -> L {
        L::dot_q8(self, x)
    }
}

impl Block for [u8; BLOCK / 2] {
    #[inline(always)]
    fn dot<L: Lanes>(&self, x: &[i16; BLOCK]) -> L {
        L::dot_q4(self, x)
    }
}

/// A row's blocks times a vector's, in two running sums.
#[inline(always)]
fn dot_of_blocks<L: Lanes, B: Block>(
    row: &[B],
    scales: &[[u16; 8]],
    x: &[[i16; BLOCK]],
    x_scales: &[[f32; 8]],
) -> f32 {
    let mut sums = [L::splat(0.0); 2];
    let groups = row.chunks(8).zip(x.chunks(8));
    for ((row, x), (scale, x_scale)) in groups.zip(scales.iter().zip(x_scales)) {
        let mut scale_of = [0.0; 8];
        L::load_half(scale).mul(L::load(x_scale)).store(&mut scale_of);
        for (i, (block, x)) in row.iter().zip(x).enumerate() {
            L::fetch(block, AHEAD);
            sums[i % 2] = block.dot::<L>(x).fma(L::splat(scale_of[i]), sums[i % 2]);
        }
    }
    sums[0].add(sums[1]).sum()
}

/// A row's chunks times a vector's, in four running sums.
#[inline(always)]
fn dot_of_chunks<L: Lanes>(
    row: &[[u16; CHUNK_WORDS]],
    scales: &[[u16; 8]],
    x: &[[i16; CHUNK]],
    x_scales: &[[f32; 8]],
) -> f32 {
    let mut sums = [L::splat(0.0); 4];
    let groups = row.chunks(2).zip(x.chunks(2));
    for ((row, x), (scale, x_scale)) in groups.zip(scales.iter().zip(x_scales)) {
        let mut scale_of = [0.0; 8];
        L::load_half(scale).mul(L::load(x_scale)).store(&mut scale_of);
        for ((words, x), scales) in row.iter().zip(x).zip(scale_of.as_chunks::<4>().0) {
            for third in words.as_chunks::<16>().0 {
                L::fetch(third, AHEAD);
            }
            let dots = L::dots_q6(words, x);
            for ((sum, dot), scale) in sums.iter_mut().zip(dots).zip(scales) {
                *sum = dot.fma(L::splat(*scale), *sum);
            }
        }
    }
    (sums[0].add(sums[1])).add(sums[2].add(sums[3])).sum()
}
