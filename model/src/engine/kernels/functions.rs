//! GELU, and scores to probabilities, eight numbers at a time.

use super::super::lanes::Lanes;

/// A function of eight numbers. Not a closure: that would be compiled for any
/// processor, and every instruction of this one be a call.
trait Eights: Copy {
    fn of<L: Lanes>(self, x: L) -> L;
}

/// Applies `f` to eight numbers at a time, the last of them filled up.
#[inline(always)]
fn map<L: Lanes>(x: &mut [f32], f: impl Eights) {
    let (eights, rest) = x.as_chunks_mut::<8>();
    for eight in eights {
        f.of(L::load(eight)).store(eight);
    }
    if !rest.is_empty() {
        let mut last = [0.0; 8];
        last[..rest.len()].copy_from_slice(rest);
        f.of(L::load(&last)).store(&mut last);
        rest.copy_from_slice(&last[..rest.len()]);
    }
}

/// e^x for x from -87 to 88 (clamped below), to two units in the last place:
/// 2^n times a polynomial, n the nearest integer to x / ln 2.
#[inline(always)]
fn exp<L: Lanes>(x: L) -> L {
    // 1.5 * 2^23: adding it leaves the nearest integer in the low bits.
    const ROUND: f32 = 12_582_912.0;
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    // Taylor's coefficients 1/6! to 1/2!; |r| is at most ln(2) / 2.
    const COEFFICIENTS: [f32; 5] = [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5];
    let x = x.max(L::splat(-87.0));
    let rounded = x.fma(L::splat(std::f32::consts::LOG2_E), L::splat(ROUND));
    let n = rounded.sub(L::splat(ROUND));
    let r = n.fma(L::splat(-LN2_HIGH), x);
    let r = n.fma(L::splat(-LN2_LOW), r);
    let mut sum = L::splat(COEFFICIENTS[0]);
    for c in &COEFFICIENTS[1..] {
        sum = sum.fma(r, L::splat(*c));
    }
    let e = sum.fma(r, L::splat(1.0)).fma(r, L::splat(1.0));
    e.mul(rounded.exponent_of_low_bits())
}

#[derive(Clone, Copy)]
struct Gelu;

impl Eights for Gelu {
    /// x * (1 + tanh(u)) / 2 = x - x / (1 + e^2u), u = sqrt(2/pi) (x + 0.044715 x^3)
    #[inline(always)]
    fn of<L: Lanes>(self, x: L) -> L {
        const TWICE: f32 = 2.0 * 0.797_884_6;
        let cubic = x.mul(x).fma(L::splat(0.044_715 * TWICE), L::splat(TWICE));
        let twice_u = cubic.mul(x);
        // Beyond +-40 it is x or 0 to the last bit.
        let low = L::splat(0.0).sub(L::splat(0.0).sub(twice_u).max(L::splat(-40.0)));
        x.sub(x.div(exp(low).add(L::splat(1.0))))
    }
}

/// e to what is left after a subtraction.
#[derive(Clone, Copy)]
struct ExpLess(f32);

impl Eights for ExpLess {
    #[inline(always)]
    fn of<L: Lanes>(self, x: L) -> L {
        exp(x.sub(L::splat(self.0)))
    }
}

#[derive(Clone, Copy)]
struct Times(f32);

impl Eights for Times {
    #[inline(always)]
    fn of<L: Lanes>(self, x: L) -> L {
        x.mul(L::splat(self.0))
    }
}

#[inline(always)]
pub(super) fn gelu<L: Lanes>(x: &mut [f32]) {
    map::<L>(x, Gelu);
}

/// ALiBi: `slope` off each score for every frame of age; the first is `age` old,
/// each further one younger by 1.
#[inline(always)]
pub(super) fn fade<L: Lanes>(scores: &mut [f32], slope: f32, age: f32) {
    let (eights, rest) = scores.as_chunks_mut::<8>();
    let mut ages = L::splat(age).sub(L::load(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]));
    let (slope, eight) = (L::splat(-slope), L::splat(8.0));
    for scores in eights {
        ages.fma(slope, L::load(scores)).store(scores);
        ages = ages.sub(eight);
    }
    let mut last = [0.0; 8];
    last[..rest.len()].copy_from_slice(rest);
    ages.fma(slope, L::load(&last)).store(&mut last);
    rest.copy_from_slice(&last[..rest.len()]);
}

#[inline(always)]
pub(super) fn softmax<L: Lanes>(scores: &mut [f32]) {
    map::<L>(scores, ExpLess(largest::<L>(scores)));
    let (eights, rest) = scores.as_chunks::<8>();
    let mut sums = L::splat(0.0);
    for eight in eights {
        sums = sums.add(L::load(eight));
    }
    let total = sums.sum() + rest.iter().sum::<f32>();
    map::<L>(scores, Times(1.0 / total));
}

/// The largest number; the order of the comparisons changes nothing.
#[inline(always)]
fn largest<L: Lanes>(x: &[f32]) -> f32 {
    let (eights, rest) = x.as_chunks::<8>();
    let mut best = L::splat(f32::NEG_INFINITY);
    for eight in eights {
        best = best.max(L::load(eight));
    }
    let mut lanes = [0.0; 8];
    best.store(&mut lanes);
    let larger = |m: f32, s: &f32| if *s > m { *s } else { m };
    lanes.iter().chain(rest).fold(f32::NEG_INFINITY, larger)
}
