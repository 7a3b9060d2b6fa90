//! What is done to a vector between two products: norm, style, and the forms in
//! which products and caches take it.

use super::super::lanes::Lanes;
use crate::weights::BLOCK;

/// Layer norm's epsilon, PyTorch's default.
const EPSILON: f32 = 1e-5;
/// The largest integer of a quantised vector.
const LARGEST: f32 = 32_767.0;

/// What a sum is taken of. Not a closure: see `functions`.
trait Term: Copy {
    fn of<L: Lanes>(self, x: L) -> L;
    fn nothing(self) -> f32;
}

#[derive(Clone, Copy)]
struct Itself;

impl Term for Itself {
    #[inline(always)]
    fn of<L: Lanes>(self, x: L) -> L {
        x
    }

    fn nothing(self) -> f32 {
        0.0
    }
}

/// The square of the distance from a number.
#[derive(Clone, Copy)]
struct SquareFrom(f32);

impl Term for SquareFrom {
    #[inline(always)]
    fn of<L: Lanes>(self, x: L) -> L {
        let gap = x.sub(L::splat(self.0));
        gap.mul(gap)
    }

    fn nothing(self) -> f32 {
        self.0
    }
}

#[inline(always)]
fn sum<L: Lanes>(x: &[f32], term: impl Term) -> f32 {
    let (eights, rest) = x.as_chunks::<8>();
    let mut sums = L::splat(0.0);
    for eight in eights {
        sums = sums.add(term.of(L::load(eight)));
    }
    if !rest.is_empty() {
        let mut last = [term.nothing(); 8];
        last[..rest.len()].copy_from_slice(rest);
        sums = sums.add(term.of(L::load(&last)));
    }
    sums.sum()
}

/// `(x - mean) / deviation * weight + bias`.
#[inline(always)]
pub(super) fn norm<L: Lanes>(out: &mut [f32], x: &[f32], weight: &[f32], bias: &[f32]) {
    let count = x.len() as f32;
    let mean = sum::<L>(x, Itself) / count;
    let variance = sum::<L>(x, SquareFrom(mean)) / count;
    let inverse = (variance + EPSILON).sqrt().recip();
    // The compiler uses vectors here by itself.
    for (((out, x), weight), bias) in out.iter_mut().zip(x).zip(weight).zip(bias) {
        *out = (x - mean) * inverse * weight + bias;
    }
}

/// Eq. 5 as a residual branch: `x + scale * x / |x| * sqrt(dim)`.
#[inline(always)]
pub(super) fn styled<L: Lanes>(x: &mut [f32], scale: &[f32]) {
    let squared = sum::<L>(x, SquareFrom(0.0));
    let factor = (x.len() as f32).sqrt() / (squared + 1e-6).sqrt();
    for (x, scale) in x.iter_mut().zip(scale) {
        *x += *x * factor * scale;
    }
}

/// Nearest integers of whole blocks, and the scale of each.
#[inline(always)]
pub(super) fn quantise<L: Lanes>(quants: &mut [i16], scales: &mut [f32], values: &[f32]) {
    let values = values.as_chunks::<BLOCK>().0;
    let quants = quants.as_chunks_mut::<BLOCK>().0;
    for (scale, (values, quants)) in scales.iter_mut().zip(values.iter().zip(quants)) {
        *scale = quantise_block::<L>(quants, values);
    }
}

#[inline(always)]
fn quantise_block<L: Lanes>(quants: &mut [i16; BLOCK], values: &[f32; BLOCK]) -> f32 {
    let values = values.as_chunks::<8>().0;
    let mut eight = L::splat(0.0);
    for values in values {
        let value = L::load(values);
        eight = eight.max(value).max(L::splat(0.0).sub(value));
    }
    let mut largest = [0.0; 8];
    eight.store(&mut largest);
    let larger = |m: f32, v: &f32| if *v > m { *v } else { m };
    let largest = largest.iter().fold(0.0, larger);
    let inverse = if largest > f32::MIN_POSITIVE { LARGEST / largest } else { 0.0 };
    let quants = quants.as_chunks_mut::<8>().0;
    for (quants, values) in quants.iter_mut().zip(values) {
        L::load(values).mul(L::splat(inverse)).store_integers(quants);
    }
    largest / LARGEST
}

/// Nearest f16 of each.
#[inline(always)]
pub(super) fn to_half<L: Lanes>(out: &mut [u16], values: &[f32]) {
    let (out, out_rest) = out.as_chunks_mut::<8>();
    let (values, rest) = values.as_chunks::<8>();
    for (out, values) in out.iter_mut().zip(values) {
        L::load(values).store_half(out);
    }
    if !rest.is_empty() {
        let (mut last, mut bits) = ([0.0; 8], [0; 8]);
        last[..rest.len()].copy_from_slice(rest);
        L::load(&last).store_half(&mut bits);
        out_rest.copy_from_slice(&bits[..rest.len()]);
    }
}
