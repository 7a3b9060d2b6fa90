//! The same eight numbers in two registers of WebAssembly's 128-bit SIMD.
//!
//! There is no fused multiply-add that every browser has and that gives the same bits on
//! every processor, so it is computed in f64: see [`fused`].
#![cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
#![allow(unsafe_code)]

use super::lanes::{Lanes, Portable};
use crate::weights::{CHUNK, CHUNK_WORDS};
use std::arch::wasm32::*;

/// Eight f32 in two registers.
#[derive(Clone, Copy)]
pub(crate) struct Simd128(v128, v128);

impl Simd128 {
    #[inline(always)]
    fn both(self, other: Self, f: impl Fn(v128, v128) -> v128) -> Self {
        Self(f(self.0, other.0), f(self.1, other.1))
    }

    #[inline(always)]
    fn of_portable(eight: Portable) -> Self {
        let mut numbers = [0.0; 8];
        eight.store(&mut numbers);
        Self::load(&numbers)
    }
}

impl Lanes for Simd128 {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(f32x4_splat(value), f32x4_splat(value))
    }

    #[inline(always)]
    fn load(values: &[f32; 8]) -> Self {
        let at = values.as_ptr().cast::<v128>();
        // SAFETY: the reference is good for 32 bytes, any alignment.
        unsafe { Self(v128_load(at), v128_load(at.add(1))) }
    }

    #[inline(always)]
    fn load_half(bits: &[u16; 8]) -> Self {
        // SAFETY: the reference is good for 16 bytes, any alignment.
        let eight = unsafe { v128_load(bits.as_ptr().cast()) };
        Self(widened(u32x4_extend_low_u16x8(eight)), widened(u32x4_extend_high_u16x8(eight)))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        let at = to.as_mut_ptr().cast::<v128>();
        // SAFETY: the reference is good for 32 bytes, any alignment.
        unsafe {
            v128_store(at, self.0);
            v128_store(at.add(1), self.1);
        }
    }

    #[inline(always)]
    fn store_integers(self, to: &mut [i16; 8]) {
        // 1.5 * 2^23: adding it leaves the nearest integer in the low bits.
        let round = f32x4_splat(12_582_912.0);
        let (low, high) = (f32x4_add(self.0, round), f32x4_add(self.1, round));
        let eight = i16x8_shuffle::<0, 2, 4, 6, 8, 10, 12, 14>(low, high);
        // SAFETY: the reference is good for 16 bytes, any alignment.
        unsafe { v128_store(to.as_mut_ptr().cast(), eight) }
    }

    #[inline(always)]
    fn store_half(self, to: &mut [u16; 8]) {
        // Once for each number that a cache takes in: not worth instructions of its own.
        let mut eight = [0.0; 8];
        self.store(&mut eight);
        Portable::load(&eight).store_half(to);
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.both(other, |a, b| f32x4_add(a, b))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.both(other, |a, b| f32x4_sub(a, b))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.both(other, |a, b| f32x4_mul(a, b))
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.both(other, |a, b| f32x4_div(a, b))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.both(other, |a, b| f32x4_pmax(b, a))
    }

    #[inline(always)]
    fn fma(self, factor: Self, term: Self) -> Self {
        let (low, low_doubt) = fused(self.0, factor.0, term.0);
        let (high, high_doubt) = fused(self.1, factor.1, term.1);
        match v128_any_true(v128_or(low_doubt, high_doubt)) {
            true => {
                Self(one_by_one(self.0, factor.0, term.0), one_by_one(self.1, factor.1, term.1))
            }
            false => Self(low, high),
        }
    }

    #[inline(always)]
    fn exponent_of_low_bits(self) -> Self {
        let biased = |four| i32x4_shl(i32x4_add(four, i32x4_splat(127)), 23);
        Self(biased(self.0), biased(self.1))
    }

    #[inline(always)]
    fn dot_q8(weights: &[i8; 32], x: &[i16; 32]) -> Self {
        let (weights, x) = (weights.as_ptr().cast::<v128>(), x.as_ptr().cast::<v128>());
        // SAFETY: the references are good for 32 and 64 bytes, any alignment.
        let (low, high, x) = unsafe {
            let x = [0, 1, 2, 3].map(|eight| v128_load(x.add(eight)));
            (v128_load(weights), v128_load(weights.add(1)), x)
        };
        let first = |w| i16x8_extend_low_i8x16(w);
        let second = |w| i16x8_extend_high_i8x16(w);
        let sum = |a, b| f32x4_convert_i32x4(i32x4_add(a, b));
        Self(
            sum(i32x4_dot_i16x8(first(low), x[0]), i32x4_dot_i16x8(first(high), x[2])),
            sum(i32x4_dot_i16x8(second(low), x[1]), i32x4_dot_i16x8(second(high), x[3])),
        )
    }

    #[inline(always)]
    fn dot_q4(weights: &[u8; 16], x: &[i16; 32]) -> Self {
        Self::of_portable(Portable::dot_q4(weights, x))
    }

    #[inline(always)]
    fn dots_q6(words: &[u16; CHUNK_WORDS], x: &[i16; CHUNK]) -> [Self; 4] {
        Portable::dots_q6(words, x).map(Self::of_portable)
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        let four = f32x4_add(self.0, self.1);
        let two = f32x4_add(four, i64x2_shuffle::<1, 1>(four, four));
        f32x4_extract_lane::<0>(two) + f32x4_extract_lane::<1>(two)
    }

    #[inline(always)]
    fn sums(of: [Self; 8]) -> Self {
        let [a, b, c, d, e, f, g, h] = of.map(|eight| f32x4_add(eight.0, eight.1));
        Self(four_sums([a, b, c, d]), four_sums([e, f, g, h]))
    }

    #[inline(always)]
    fn fetch<T>(_: &T, _: usize) {}
}

/// The sum of each four: first and third, second and fourth, then both.
#[inline(always)]
fn four_sums([a, b, c, d]: [v128; 4]) -> v128 {
    let twos = |one, other| {
        f32x4_add(i64x2_shuffle::<0, 2>(one, other), i64x2_shuffle::<1, 3>(one, other))
    };
    let (low, high) = (twos(a, b), twos(c, d));
    let first = i32x4_shuffle::<0, 2, 4, 6>(low, high);
    f32x4_add(first, i32x4_shuffle::<1, 3, 5, 7>(low, high))
}

/// Finite f16 in 32 bits each to f32, without a branch: the exponent is moved by a
/// product, which also takes the numbers below the normal ones right.
#[inline(always)]
fn widened(half: v128) -> v128 {
    const TWO_TO_112: f32 = f32::from_bits((112 + 127) << 23);
    let magnitude = u32x4_shl(v128_and(half, u32x4_splat(0x7fff)), 13);
    let magnitude = f32x4_mul(magnitude, f32x4_splat(TWO_TO_112));
    v128_or(magnitude, u32x4_shl(v128_and(half, u32x4_splat(0x8000)), 16))
}

/// `a * b + c`, rounded once, and bits where that is in doubt.
///
/// The product of two f32 is exact in f64. The sum is rounded to 53 bits and then to 24,
/// which is wrong only if the first rounding ends on the middle between two f32, or if the
/// result is below the normal numbers: then there is doubt, and it is to be computed anew.
#[inline(always)]
fn fused(a: v128, b: v128, c: v128) -> (v128, v128) {
    let wide = |a, b, c| {
        let product = f64x2_mul(f64x2_promote_low_f32x4(a), f64x2_promote_low_f32x4(b));
        f64x2_add(product, f64x2_promote_low_f32x4(c))
    };
    let upper = |four| i64x2_shuffle::<1, 1>(four, four);
    let (low, high) = (wide(a, b, c), wide(upper(a), upper(b), upper(c)));
    // Not one shuffle of both: the compiler would make four scalar conversions of it.
    let upper_sums = i64x2_shuffle::<2, 0>(f32x4_demote_f64x2_zero(high), i64x2_splat(0));
    let sums = v128_or(f32x4_demote_f64x2_zero(low), upper_sums);
    let rest = v128_and(i32x4_shuffle::<0, 2, 4, 6>(low, high), u32x4_splat(0x1fff_ffff));
    let middle = i32x4_eq(rest, u32x4_splat(0x1000_0000));
    // 0 is none of them: one less is the largest of all.
    let bits = i32x4_sub(v128_and(sums, u32x4_splat(0x7fff_ffff)), i32x4_splat(1));
    let tiny = u32x4_lt(bits, f32x4_splat(f32::MIN_POSITIVE));
    (sums, v128_or(middle, tiny))
}

/// Rare, but not a function to be called: its arguments would go through memory every time.
#[inline(always)]
fn one_by_one(a: v128, b: v128, c: v128) -> v128 {
    f32x4(
        f32x4_extract_lane::<0>(a).mul_add(f32x4_extract_lane::<0>(b), f32x4_extract_lane::<0>(c)),
        f32x4_extract_lane::<1>(a).mul_add(f32x4_extract_lane::<1>(b), f32x4_extract_lane::<1>(c)),
        f32x4_extract_lane::<2>(a).mul_add(f32x4_extract_lane::<2>(b), f32x4_extract_lane::<2>(c)),
        f32x4_extract_lane::<3>(a).mul_add(f32x4_extract_lane::<3>(b), f32x4_extract_lane::<3>(c)),
    )
}
