//! Eight numbers at a time: what the kernels are written in.
//!
//! Every implementation computes the same bits (fused multiply-add, one order
//! of sums), so that a dance does not depend on the processor.

use half::f16;

use crate::weights::{BLOCK, CHUNK, CHUNK_WORDS, q6_quant};

/// Eight f32 numbers, in a register or an array.
pub(crate) trait Lanes: Copy {
    fn splat(value: f32) -> Self;
    fn load(values: &[f32; 8]) -> Self;
    /// From f16 in memory.
    fn load_half(bits: &[u16; 8]) -> Self;
    fn store(self, to: &mut [f32; 8]);
    /// As the nearest integers (even ones in the middle), of numbers that fit.
    fn store_integers(self, to: &mut [i16; 8]);
    /// As the nearest f16.
    fn store_half(self, to: &mut [u16; 8]);
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    fn max(self, other: Self) -> Self;
    /// `self * factor + term`, rounded once.
    fn fma(self, factor: Self, term: Self) -> Self;
    /// 2 to the integer that is in the lowest mantissa bits.
    fn exponent_of_low_bits(self) -> Self;
    /// Products of a `q8_0` block, summed to eight (exact).
    fn dot_q8(weights: &[i8; 32], x: &[i16; 32]) -> Self;
    /// Products of a `q4_0` block, summed to eight (exact).
    fn dot_q4(weights: &[u8; 16], x: &[i16; 32]) -> Self;
    /// Products of the blocks of a `q6` chunk, each summed to eight (exact).
    fn dots_q6(words: &[u16; CHUNK_WORDS], x: &[i16; CHUNK]) -> [Self; 4];
    fn sum(self) -> f32;
    /// The sum of each, in the same order.
    fn sums(of: [Self; 8]) -> Self;
    /// Asks for the memory so many bytes behind `place`, if the processor can be
    /// asked; there need not be any.
    fn fetch<T>(place: &T, bytes: usize);
}

/// Plain Rust, which the compiler turns into what the processor has.
#[derive(Clone, Copy)]
pub(crate) struct Portable([f32; 8]);

impl Portable {
    #[inline(always)]
    fn both(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }
}

impl Lanes for Portable {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; 8])
    }

    #[inline(always)]
    fn load(values: &[f32; 8]) -> Self {
        Self(*values)
    }

    #[inline(always)]
    fn load_half(bits: &[u16; 8]) -> Self {
        Self(bits.map(half_to_f32))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        *to = self.0;
    }

    #[inline(always)]
    fn store_integers(self, to: &mut [i16; 8]) {
        // 1.5 * 2^23: adding it leaves the nearest integer in the low bits.
        const ROUND: f32 = 12_582_912.0;
        *to = self.0.map(|v| (v + ROUND).to_bits() as i16);
    }

    #[inline(always)]
    fn store_half(self, to: &mut [u16; 8]) {
        *to = self.0.map(|v| f16::from_f32(v).to_bits());
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.both(other, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.both(other, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.both(other, |a, b| a * b)
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.both(other, |a, b| a / b)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.both(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn fma(self, factor: Self, term: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i].mul_add(factor.0[i], term.0[i])))
    }

    #[inline(always)]
    fn exponent_of_low_bits(self) -> Self {
        Self(self.0.map(|v| f32::from_bits(v.to_bits().wrapping_add(127) << 23)))
    }

    #[inline(always)]
    fn dot_q8(weights: &[i8; 32], x: &[i16; 32]) -> Self {
        pairs(|i| i32::from(weights[i]) * i32::from(x[i]))
    }

    #[inline(always)]
    fn dot_q4(weights: &[u8; 16], x: &[i16; 32]) -> Self {
        pairs(|i| {
            let nibble = if i < 16 { weights[i] & 15 } else { weights[i - 16] >> 4 };
            (i32::from(nibble) - 8) * i32::from(x[i])
        })
    }

    #[inline(always)]
    fn dots_q6(words: &[u16; CHUNK_WORDS], x: &[i16; CHUNK]) -> [Self; 4] {
        std::array::from_fn(|block| {
            pairs(|i| {
                let n = block * BLOCK + i;
                i32::from(q6_quant(words, n)) * i32::from(x[n])
            })
        })
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        let v = self.0;
        let four: [f32; 4] = std::array::from_fn(|i| v[i] + v[i + 4]);
        (four[0] + four[2]) + (four[1] + four[3])
    }

    #[inline(always)]
    fn sums(of: [Self; 8]) -> Self {
        Self(of.map(Self::sum))
    }

    #[inline(always)]
    fn fetch<T>(_: &T, _: usize) {}
}

/// Lane i: products 2i, 2i+1, 2i+16, 2i+17. At most 2^24 each, so exact.
#[inline(always)]
fn pairs(product: impl Fn(usize) -> i32) -> Portable {
    Portable(std::array::from_fn(|i| {
        let low = product(2 * i) + product(2 * i + 1);
        (low + product(2 * i + 16) + product(2 * i + 17)) as f32
    }))
}

/// f16 to f32 for finite numbers, without a branch: the exponent is moved by a
/// product, which also takes the numbers below the normal ones right.
#[inline(always)]
fn half_to_f32(bits: u16) -> f32 {
    const TWO_TO_112: f32 = f32::from_bits((112 + 127) << 23);
    let magnitude = f32::from_bits(u32::from(bits & 0x7fff) << 13) * TWO_TO_112;
    f32::from_bits(magnitude.to_bits() | u32::from(bits & 0x8000) << 16)
}
