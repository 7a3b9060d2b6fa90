//! The same eight numbers in a register of an x86-64 processor with AVX2, FMA
//! and F16C.
//!
//! AVX-512 would gain nothing here: the products wait for memory.
#![cfg(target_arch = "x86_64")]
#![allow(unsafe_code)]

use super::lanes::Lanes;
use crate::weights::{BLOCK, CHUNK, CHUNK_WORDS};
use std::arch::x86_64::*;

/// Eight f32 in a register. Used only inside functions that are compiled for
/// `avx2,fma,f16c` and called after the processor was asked for them
/// (`kernels`): that is the safety of every intrinsic below.
#[derive(Clone, Copy)]
pub(crate) struct Avx2(__m256);

impl Lanes for Avx2 {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm256_set1_ps(value) })
    }

    #[inline(always)]
    fn load(values: &[f32; 8]) -> Self {
        // SAFETY: see the type; the reference is good for 32 bytes, any alignment.
        Self(unsafe { _mm256_loadu_ps(values.as_ptr()) })
    }

    #[inline(always)]
    fn load_half(bits: &[u16; 8]) -> Self {
        // SAFETY: see the type; the reference is good for 16 bytes, any alignment.
        Self(unsafe { _mm256_cvtph_ps(_mm_loadu_si128(bits.as_ptr().cast())) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        // SAFETY: see the type; the reference is good for 32 bytes, any alignment.
        unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn store_integers(self, to: &mut [i16; 8]) {
        // SAFETY: see the type; the reference is good for 16 bytes, any alignment.
        unsafe {
            let nearest = _mm256_cvtps_epi32(self.0);
            let high = _mm256_extracti128_si256::<1>(nearest);
            let eight = _mm_packs_epi32(_mm256_castsi256_si128(nearest), high);
            _mm_storeu_si128(to.as_mut_ptr().cast(), eight);
        }
    }

    #[inline(always)]
    fn store_half(self, to: &mut [u16; 8]) {
        // SAFETY: see the type; the reference is good for 16 bytes, any alignment.
        unsafe {
            let eight = _mm256_cvtps_ph::<_MM_FROUND_TO_NEAREST_INT>(self.0);
            _mm_storeu_si128(to.as_mut_ptr().cast(), eight);
        }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm256_add_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm256_sub_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm256_mul_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm256_div_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn fma(self, factor: Self, term: Self) -> Self {
        // SAFETY: see the type.
        Self(unsafe { _mm256_fmadd_ps(self.0, factor.0, term.0) })
    }

    #[inline(always)]
    fn exponent_of_low_bits(self) -> Self {
        // SAFETY: see the type.
        Self(unsafe {
            let biased = _mm256_add_epi32(_mm256_castps_si256(self.0), _mm256_set1_epi32(127));
            _mm256_castsi256_ps(_mm256_slli_epi32::<23>(biased))
        })
    }

    #[inline(always)]
    fn dot_q8(weights: &[i8; 32], x: &[i16; 32]) -> Self {
        // SAFETY: see the type; 32 and 64 bytes behind the references.
        Self(unsafe {
            let (w, x) = (weights.as_ptr(), x.as_ptr());
            let low = _mm256_cvtepi8_epi16(_mm_loadu_si128(w.cast()));
            let high = _mm256_cvtepi8_epi16(_mm_loadu_si128(w.add(16).cast()));
            sum_of_products(low, high, x)
        })
    }

    #[inline(always)]
    fn dot_q4(weights: &[u8; 16], x: &[i16; 32]) -> Self {
        // SAFETY: see the type; 16 and 64 bytes behind the references.
        Self(unsafe {
            let bytes = _mm256_cvtepu8_epi16(_mm_loadu_si128(weights.as_ptr().cast()));
            let eight = _mm256_set1_epi16(8);
            let low = _mm256_and_si256(bytes, _mm256_set1_epi16(15));
            let high = _mm256_srli_epi16::<4>(bytes);
            let (low, high) = (_mm256_sub_epi16(low, eight), _mm256_sub_epi16(high, eight));
            sum_of_products(low, high, x.as_ptr())
        })
    }

    #[inline(always)]
    fn dots_q6(words: &[u16; CHUNK_WORDS], x: &[i16; CHUNK]) -> [Self; 4] {
        // SAFETY: see the type; 96 and 256 bytes behind the references.
        unsafe {
            let third = |i: usize| _mm256_loadu_si256(words.as_ptr().add(16 * i).cast());
            let (a, b, c) = (third(0), third(1), third(2));
            let first = |v| _mm256_srai_epi16::<10>(_mm256_slli_epi16::<10>(v));
            let second = |v| _mm256_srai_epi16::<10>(_mm256_slli_epi16::<4>(v));
            // Four bits on top of one, and two of `b` below them.
            let joined = |top, low| {
                let top = _mm256_and_si256(top, _mm256_set1_epi16(0xf000u16 as i16));
                let low = _mm256_and_si256(low, _mm256_set1_epi16(0x0c00));
                _mm256_srai_epi16::<10>(_mm256_or_si256(top, low))
            };
            let sixth = joined(a, _mm256_srli_epi16::<2>(b));
            let last = joined(c, _mm256_srli_epi16::<4>(b));
            let x = |block: usize| x.as_ptr().add(BLOCK * block);
            [
                Self(sum_of_products(first(a), second(a), x(0))),
                Self(sum_of_products(first(b), second(b), x(1))),
                Self(sum_of_products(first(c), second(c), x(2))),
                Self(sum_of_products(sixth, last, x(3))),
            ]
        }
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        // SAFETY: see the type.
        unsafe {
            let low = _mm256_castps256_ps128(self.0);
            let four = _mm_add_ps(low, _mm256_extractf128_ps::<1>(self.0));
            let two = _mm_add_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_add_ss(two, _mm_movehdup_ps(two)))
        }
    }

    #[inline(always)]
    fn sums(of: [Self; 8]) -> Self {
        // SAFETY: see the type.
        Self(unsafe {
            let [a, b, c, d, e, f, g, h] = of.map(|eight| eight.0);
            let low = quarters(halves(a, e), halves(b, f));
            let high = quarters(halves(c, g), halves(d, h));
            let first = _mm256_shuffle_ps::<0b10_00_10_00>(low, high);
            _mm256_add_ps(first, _mm256_shuffle_ps::<0b11_01_11_01>(low, high))
        })
    }

    #[inline(always)]
    fn fetch<T>(place: &T, bytes: usize) {
        let there = std::ptr::from_ref(place).cast::<i8>().wrapping_add(bytes);
        // SAFETY: see the type; fetching ahead reads nothing that is seen.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(there) }
    }
}

/// 32 integers in two registers times 32 at `x`.
///
/// # Safety
/// AVX2, and 64 readable bytes at `x`.
#[inline(always)]
unsafe fn sum_of_products(low: __m256i, high: __m256i, x: *const i16) -> __m256 {
    // SAFETY: the caller's promise.
    unsafe {
        let low = _mm256_madd_epi16(low, _mm256_loadu_si256(x.cast()));
        let high = _mm256_madd_epi16(high, _mm256_loadu_si256(x.add(16).cast()));
        _mm256_cvtepi32_ps(_mm256_add_epi32(low, high))
    }
}

/// The halves of each added: four sums of `low`, then four of `high`.
///
/// # Safety
/// AVX2.
#[inline(always)]
unsafe fn halves(low: __m256, high: __m256) -> __m256 {
    // SAFETY: the caller's promise.
    unsafe {
        let first = _mm256_permute2f128_ps::<0x20>(low, high);
        _mm256_add_ps(first, _mm256_permute2f128_ps::<0x31>(low, high))
    }
}

/// Of every four the halves added: two sums of `one`, two of `other`, by turns.
///
/// # Safety
/// AVX2.
#[inline(always)]
unsafe fn quarters(one: __m256, other: __m256) -> __m256 {
    // SAFETY: the caller's promise.
    unsafe {
        let first = _mm256_shuffle_ps::<0b01_00_01_00>(one, other);
        _mm256_add_ps(first, _mm256_shuffle_ps::<0b11_10_11_10>(one, other))
    }
}
