//! The loops that take the time, each written once over [`Lanes`] and compiled
//! for plain Rust and for AVX2; which one runs is asked of the processor.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
use super::avx2::Avx2;
use super::dtype::BLOCK;
use super::lanes::{Lanes, Portable};

/// Numbers whose scales are taken together.
const GROUP: usize = 8 * BLOCK;

/// Which compilation of the kernels runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cpu(Kind);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Cpu {
    /// The best for this processor.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("f16c")
        {
            return Self(Kind::Avx2);
        }
        Self::portable()
    }

    /// Plain Rust, which runs everywhere and gives the same bits.
    pub fn portable() -> Self {
        Self(Kind::Portable)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self.0 {
            Kind::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 => "avx2",
        }
    }
}

/// Makes `name(cpu, arguments)` out of a body over [`Lanes`].
macro_rules! kernel {
    ($(#[$doc:meta])* $name:ident = $body:ident($($arg:ident: $type:ty),*)) => {
        $(#[$doc])*
        #[allow(clippy::too_many_arguments)]
        pub(crate) fn $name(cpu: Cpu, $($arg: $type),*) {
            match cpu.0 {
                Kind::Portable => $body::<Portable>($($arg),*),
                #[cfg(target_arch = "x86_64")]
                Kind::Avx2 => {
                    #[target_feature(enable = "avx2,fma,f16c")]
                    fn compiled_for_it($($arg: $type),*) {
                        $body::<Avx2>($($arg),*)
                    }
                    // SAFETY: only `detect` makes this kind, after it found
                    // these features.
                    unsafe { compiled_for_it($($arg),*) }
                }
            }
        }
    };
}

kernel! {
    /// Rows of f32 times each of `x` (vectors of a row's width): `out` takes the
    /// products of the first row, then of the second.
    rows_f32 = rows_f32_body(out: &mut [f32], weights: &[f32], x: &[f32], width: usize)
}
kernel! {
    /// The same with rows of f16.
    rows_f16 = rows_f16_body(out: &mut [f32], weights: &[u16], x: &[f32], width: usize)
}
kernel! {
    /// The same with `q8_0` rows; `x` are integers with a scale per block, and
    /// rows of scales are `8 * width.div_ceil(256)` long.
    rows_q8 = rows_q8_body(out: &mut [f32], weights: &[i8], scales: &[u16], x: &[i16], x_scales: &[f32], width: usize)
}
kernel! {
    /// The same with `q4_0` rows.
    rows_q4 = rows_q4_body(out: &mut [f32], weights: &[u8], scales: &[u16], x: &[i16], x_scales: &[f32], width: usize)
}
kernel! {
    /// `x` to GELU(x), tanh form, in place.
    gelu = gelu_body(x: &mut [f32])
}
kernel! {
    /// Scores of a query against rows of f32 keys, one for each score.
    scores_f32 = scores_f32_body(scores: &mut [f32], keys: &[f32], query: &[f32])
}
kernel! {
    /// The same with keys in f16.
    scores_f16 = scores_f16_body(scores: &mut [f32], keys: &[u16], query: &[f32])
}
kernel! {
    /// Scores to probabilities, in place.
    softmax = softmax_body(scores: &mut [f32])
}
kernel! {
    /// Rows of f32 values, weighted and summed.
    mix_f32 = mix_f32_body(out: &mut [f32], weights: &[f32], values: &[f32])
}
kernel! {
    /// The same with values in f16.
    mix_f16 = mix_f16_body(out: &mut [f32], weights: &[f32], values: &[u16])
}

/// Eight numbers of a row: how f32 and f16 rows are read by the same code.
trait Stored: Copy {
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
        let pairs = row.as_chunks::<8>().0.iter().zip(x.as_chunks::<8>().0);
        for (sum, (w, v)) in sums.iter_mut().zip(pairs) {
            *sum = S::load::<L>(w).fma(L::load(v), *sum);
        }
    }
    let rest = row_rest
        .as_chunks::<8>()
        .0
        .iter()
        .zip(x_rest.as_chunks::<8>().0);
    for (w, v) in rest {
        sums[0] = S::load::<L>(w).fma(L::load(v), sums[0]);
    }
    (sums[0].add(sums[1])).add(sums[2].add(sums[3])).sum()
}

#[inline(always)]
fn rows<L: Lanes, S: Stored>(out: &mut [f32], weights: &[S], x: &[f32], width: usize) {
    let lanes = x.len() / width;
    for (out, row) in out.chunks_exact_mut(lanes).zip(weights.chunks_exact(width)) {
        for (out, x) in out.iter_mut().zip(x.chunks_exact(width)) {
            *out = dot::<L, S>(row, x);
        }
    }
}

#[inline(always)]
fn rows_f32_body<L: Lanes>(out: &mut [f32], weights: &[f32], x: &[f32], width: usize) {
    rows::<L, f32>(out, weights, x, width);
}

#[inline(always)]
fn rows_f16_body<L: Lanes>(out: &mut [f32], weights: &[u16], x: &[f32], width: usize) {
    rows::<L, u16>(out, weights, x, width);
}

/// Rows of blocks of `N` stored things each.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn rows_of_blocks<L: Lanes, W, const N: usize>(
    out: &mut [f32],
    weights: &[W],
    scales: &[u16],
    x: &[i16],
    x_scales: &[f32],
    width: usize,
    block_dot: impl Fn(&[W; N], &[i16; BLOCK]) -> L,
) {
    let lanes = x.len() / width;
    let scales_width = 8 * width.div_ceil(GROUP);
    let rows = weights.chunks_exact(width / BLOCK * N);
    let rows = rows.zip(scales.chunks_exact(scales_width));
    for (out, (row, scales)) in out.chunks_exact_mut(lanes).zip(rows) {
        let row = row.as_chunks::<N>().0;
        let x = x
            .chunks_exact(width)
            .zip(x_scales.chunks_exact(scales_width));
        for (out, (x, x_scales)) in out.iter_mut().zip(x) {
            let x = x.as_chunks::<BLOCK>().0;
            let mut sums = [L::splat(0.0); 2];
            let groups = row.chunks(8).zip(x.chunks(8));
            let both = scales
                .as_chunks::<8>()
                .0
                .iter()
                .zip(x_scales.as_chunks::<8>().0);
            for ((row, x), (scale, x_scale)) in groups.zip(both) {
                let mut scale_of = [0.0; 8];
                L::load_half(scale)
                    .mul(L::load(x_scale))
                    .store(&mut scale_of);
                for (i, (w, x)) in row.iter().zip(x).enumerate() {
                    sums[i % 2] = block_dot(w, x).fma(L::splat(scale_of[i]), sums[i % 2]);
                }
            }
            *out = sums[0].add(sums[1]).sum();
        }
    }
}

#[inline(always)]
fn rows_q8_body<L: Lanes>(
    out: &mut [f32],
    weights: &[i8],
    scales: &[u16],
    x: &[i16],
    x_scales: &[f32],
    width: usize,
) {
    rows_of_blocks::<L, i8, 32>(out, weights, scales, x, x_scales, width, |w, x| {
        L::dot_q8(w, x)
    });
}

#[inline(always)]
fn rows_q4_body<L: Lanes>(
    out: &mut [f32],
    weights: &[u8],
    scales: &[u16],
    x: &[i16],
    x_scales: &[f32],
    width: usize,
) {
    rows_of_blocks::<L, u8, 16>(out, weights, scales, x, x_scales, width, |w, x| {
        L::dot_q4(w, x)
    });
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

/// Applies `f` to eight numbers at a time, the last of them filled up.
#[inline(always)]
fn map<L: Lanes>(x: &mut [f32], f: impl Fn(L) -> L) {
    let (eights, rest) = x.as_chunks_mut::<8>();
    for eight in eights {
        f(L::load(eight)).store(eight);
    }
    let mut last = [0.0; 8];
    last[..rest.len()].copy_from_slice(rest);
    f(L::load(&last)).store(&mut last);
    rest.copy_from_slice(&last[..rest.len()]);
}

#[inline(always)]
fn gelu_body<L: Lanes>(x: &mut [f32]) {
    // x * (1 + tanh(u)) / 2 = x - x / (1 + e^2u), u = sqrt(2/pi) (x + 0.044715 x^3)
    const TWICE: f32 = 2.0 * 0.797_884_6;
    map(x, |x: L| {
        let cubic = x.mul(x).fma(L::splat(0.044_715 * TWICE), L::splat(TWICE));
        let twice_u = cubic.mul(x);
        // Beyond +-40 it is x or 0 to the last bit.
        let low = L::splat(0.0).sub(L::splat(0.0).sub(twice_u).max(L::splat(-40.0)));
        x.sub(x.div(exp(low).add(L::splat(1.0))))
    });
}

#[inline(always)]
fn scores_body<L: Lanes, S: Stored>(scores: &mut [f32], keys: &[S], query: &[f32]) {
    for (score, key) in scores.iter_mut().zip(keys.chunks_exact(query.len())) {
        *score = dot::<L, S>(key, query);
    }
}

#[inline(always)]
fn scores_f32_body<L: Lanes>(scores: &mut [f32], keys: &[f32], query: &[f32]) {
    scores_body::<L, f32>(scores, keys, query);
}

#[inline(always)]
fn scores_f16_body<L: Lanes>(scores: &mut [f32], keys: &[u16], query: &[f32]) {
    scores_body::<L, u16>(scores, keys, query);
}

#[inline(always)]
fn softmax_body<L: Lanes>(scores: &mut [f32]) {
    let largest = scores
        .iter()
        .fold(f32::NEG_INFINITY, |m, s| if *s > m { *s } else { m });
    map(scores, |s: L| exp(s.sub(L::splat(largest))));
    let (eights, rest) = scores.as_chunks::<8>();
    let sum = eights
        .iter()
        .fold(L::splat(0.0), |sum, eight| sum.add(L::load(eight)));
    let total = sum.sum() + rest.iter().sum::<f32>();
    map(scores, |s: L| s.mul(L::splat(1.0 / total)));
}

/// `N` times eight columns from `column` on.
#[inline(always)]
fn mix_columns<L: Lanes, S: Stored, const N: usize>(
    out: &mut [f32],
    weights: &[f32],
    values: &[S],
    column: usize,
) {
    let mut sums = [L::splat(0.0); N];
    for (weight, row) in weights.iter().zip(values.chunks_exact(out.len())) {
        let weight = L::splat(*weight);
        let row = row[column..column + 8 * N].as_chunks::<8>().0;
        for (sum, v) in sums.iter_mut().zip(row) {
            *sum = S::load::<L>(v).fma(weight, *sum);
        }
    }
    let out = out[column..column + 8 * N].as_chunks_mut::<8>().0;
    for (sum, out) in sums.iter().zip(out) {
        sum.store(out);
    }
}

#[inline(always)]
fn mix_body<L: Lanes, S: Stored>(out: &mut [f32], weights: &[f32], values: &[S]) {
    let mut column = 0;
    while out.len() - column >= 64 {
        mix_columns::<L, S, 8>(out, weights, values, column);
        column += 64;
    }
    while out.len() - column >= 32 {
        mix_columns::<L, S, 4>(out, weights, values, column);
        column += 32;
    }
    while out.len() - column >= 8 {
        mix_columns::<L, S, 1>(out, weights, values, column);
        column += 8;
    }
}

#[inline(always)]
fn mix_f32_body<L: Lanes>(out: &mut [f32], weights: &[f32], values: &[f32]) {
    mix_body::<L, f32>(out, weights, values);
}

#[inline(always)]
fn mix_f16_body<L: Lanes>(out: &mut [f32], weights: &[f32], values: &[u16]) {
    mix_body::<L, u16>(out, weights, values);
}
