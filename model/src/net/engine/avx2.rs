//! The same eight numbers in a register of an x86-64 processor with AVX2, FMA
//! and F16C.
//!
//! AVX-512 would gain nothing here: the products wait for memory.
#![cfg(target_arch = "x86_64")]
#![allow(unsafe_code)]

use super::lanes::Lanes;
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
