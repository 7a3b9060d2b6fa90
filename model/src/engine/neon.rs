//! The same eight numbers in two registers of an aarch64 processor.
//!
//! Every such processor has these instructions, so nobody is asked for them. The conversions
//! of f16 are written as assembly: their intrinsics are not in every Rust that builds this.
//!
//! The dot-product instructions are left out. They multiply bytes, and activations have 16
//! bits here: docs/measurements/arm.md counts both ways.
#![cfg(target_arch = "aarch64")]
#![allow(unsafe_code)]

use super::lanes::Lanes;
use crate::weights::{BLOCK, CHUNK, CHUNK_WORDS};
use std::arch::aarch64::*;
use std::arch::asm;

/// Eight f32 in two registers. NEON belongs to every target of this architecture: that is the
/// safety of every intrinsic below.
#[derive(Clone, Copy)]
pub(crate) struct Neon(float32x4_t, float32x4_t);

impl Neon {
    #[inline(always)]
    fn both(self, other: Self, f: impl Fn(float32x4_t, float32x4_t) -> float32x4_t) -> Self {
        Self(f(self.0, other.0), f(self.1, other.1))
    }
}

impl Lanes for Neon {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        // SAFETY: see the type.
        let four = unsafe { vdupq_n_f32(value) };
        Self(four, four)
    }

    #[inline(always)]
    fn load(values: &[f32; 8]) -> Self {
        // SAFETY: see the type; the reference is good for 32 bytes, any alignment.
        unsafe { Self(vld1q_f32(values.as_ptr()), vld1q_f32(values.as_ptr().add(4))) }
    }

    #[inline(always)]
    fn load_half(bits: &[u16; 8]) -> Self {
        let (low, high);
        // SAFETY: see the type; the reference is good for 16 bytes, and nothing is written.
        unsafe {
            asm!(
                "fcvtl {low:v}.4s, {half:v}.4h",
                "fcvtl2 {high:v}.4s, {half:v}.8h",
                half = in(vreg) vld1q_u16(bits.as_ptr()),
                low = out(vreg) low,
                high = lateout(vreg) high,
                options(pure, nomem, nostack, preserves_flags),
            );
        }
        Self(low, high)
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        // SAFETY: see the type; the reference is good for 32 bytes, any alignment.
        unsafe {
            vst1q_f32(to.as_mut_ptr(), self.0);
            vst1q_f32(to.as_mut_ptr().add(4), self.1);
        }
    }

    #[inline(always)]
    fn store_integers(self, to: &mut [i16; 8]) {
        // SAFETY: see the type; the reference is good for 16 bytes, any alignment.
        unsafe {
            let low = vqmovn_s32(vcvtnq_s32_f32(self.0));
            vst1q_s16(to.as_mut_ptr(), vqmovn_high_s32(low, vcvtnq_s32_f32(self.1)));
        }
    }

    #[inline(always)]
    fn store_half(self, to: &mut [u16; 8]) {
        let half: uint16x8_t;
        // SAFETY: see the type; the reference is good for 16 bytes, any alignment.
        unsafe {
            asm!(
                "fcvtn {half:v}.4h, {low:v}.4s",
                "fcvtn2 {half:v}.8h, {high:v}.4s",
                low = in(vreg) self.0,
                high = in(vreg) self.1,
                half = out(vreg) half,
                options(pure, nomem, nostack, preserves_flags),
            );
            vst1q_u16(to.as_mut_ptr(), half);
        }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: see the type.
        self.both(other, |a, b| unsafe { vaddq_f32(a, b) })
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: see the type.
        self.both(other, |a, b| unsafe { vsubq_f32(a, b) })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: see the type.
        self.both(other, |a, b| unsafe { vmulq_f32(a, b) })
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: see the type.
        self.both(other, |a, b| unsafe { vdivq_f32(a, b) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // Not `vmaxq_f32`, which takes zeros and what is no number otherwise than the others.
        // SAFETY: see the type.
        self.both(other, |a, b| unsafe { vbslq_f32(vcgtq_f32(a, b), a, b) })
    }

    #[inline(always)]
    fn fma(self, factor: Self, term: Self) -> Self {
        // SAFETY: see the type.
        unsafe { Self(vfmaq_f32(term.0, self.0, factor.0), vfmaq_f32(term.1, self.1, factor.1)) }
    }

    #[inline(always)]
    fn exponent_of_low_bits(self) -> Self {
        // SAFETY: see the type.
        let biased = |four| unsafe {
            let biased = vaddq_s32(vreinterpretq_s32_f32(four), vdupq_n_s32(127));
            vreinterpretq_f32_s32(vshlq_n_s32::<23>(biased))
        };
        Self(biased(self.0), biased(self.1))
    }

    #[inline(always)]
    fn dot_q8(weights: &[i8; 32], x: &[i16; 32]) -> Self {
        // SAFETY: see the type; 32 and 64 bytes behind the references.
        unsafe {
            let (low, high) = (vld1q_s8(weights.as_ptr()), vld1q_s8(weights.as_ptr().add(16)));
            sum_of_bytes(low, high, x.as_ptr())
        }
    }

    #[inline(always)]
    fn dot_q4(weights: &[u8; 16], x: &[i16; 32]) -> Self {
        // SAFETY: see the type; 16 and 64 bytes behind the references.
        unsafe {
            let bytes = vld1q_u8(weights.as_ptr());
            let signed = |nibbles| vsubq_s8(vreinterpretq_s8_u8(nibbles), vdupq_n_s8(8));
            let low = signed(vandq_u8(bytes, vdupq_n_u8(15)));
            sum_of_bytes(low, signed(vshrq_n_u8::<4>(bytes)), x.as_ptr())
        }
    }

    #[inline(always)]
    fn dots_q6(words: &[u16; CHUNK_WORDS], x: &[i16; CHUNK]) -> [Self; 4] {
        // SAFETY: see the type; 96 and 256 bytes behind the references.
        unsafe {
            let eight = |i: usize| vreinterpretq_s16_u16(vld1q_u16(words.as_ptr().add(8 * i)));
            let (a, b, c) = ([eight(0), eight(1)], [eight(2), eight(3)], [eight(4), eight(5)]);
            let first = |two: [int16x8_t; 2]| two.map(|v| vshrq_n_s16::<10>(vshlq_n_s16::<10>(v)));
            let second = |two: [int16x8_t; 2]| two.map(|v| vshrq_n_s16::<10>(vshlq_n_s16::<4>(v)));
            // Four bits on top of one, and two of `b` below them.
            let joined = |top: [int16x8_t; 2], low: [int16x8_t; 2]| {
                [0, 1].map(|i| {
                    let top = vandq_s16(top[i], vdupq_n_s16(0xf000u16 as i16));
                    let low = vandq_s16(low[i], vdupq_n_s16(0x0c00));
                    vshrq_n_s16::<10>(vorrq_s16(top, low))
                })
            };
            let sixth = joined(a, b.map(|v| vshrq_n_s16::<2>(v)));
            let last = joined(c, b.map(|v| vshrq_n_s16::<4>(v)));
            let x = |block: usize| x.as_ptr().add(BLOCK * block);
            [
                sum_of_products(first(a), second(a), x(0)),
                sum_of_products(first(b), second(b), x(1)),
                sum_of_products(first(c), second(c), x(2)),
                sum_of_products(sixth, last, x(3)),
            ]
        }
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        // SAFETY: see the type.
        unsafe {
            let four = vaddq_f32(self.0, self.1);
            vpadds_f32(vadd_f32(vget_low_f32(four), vget_high_f32(four)))
        }
    }

    #[inline(always)]
    fn sums(of: [Self; 8]) -> Self {
        // SAFETY: see the type.
        unsafe {
            let [a, b, c, d, e, f, g, h] = of.map(|eight| vaddq_f32(eight.0, eight.1));
            Self(four_sums([a, b, c, d]), four_sums([e, f, g, h]))
        }
    }

    #[inline(always)]
    fn fetch<T>(place: &T, bytes: usize) {
        let there = std::ptr::from_ref(place).cast::<i8>().wrapping_add(bytes);
        // SAFETY: fetching ahead reads nothing that is seen, and fails at no address.
        unsafe {
            asm!(
                "prfm pldl1keep, [{there}]",
                there = in(reg) there,
                options(readonly, nostack, preserves_flags),
            );
        }
    }
}

/// 32 bytes in two registers times 32 integers at `x`.
///
/// # Safety
/// 64 readable bytes at `x`.
#[inline(always)]
unsafe fn sum_of_bytes(low: int8x16_t, high: int8x16_t, x: *const i16) -> Neon {
    // SAFETY: the caller's promise.
    unsafe {
        let wide = |v| [vmovl_s8(vget_low_s8(v)), vmovl_high_s8(v)];
        sum_of_products(wide(low), wide(high), x)
    }
}

/// 32 integers in two pairs of registers times 32 at `x`: lane i has the products 2i, 2i+1,
/// 2i+16 and 2i+17.
///
/// # Safety
/// 64 readable bytes at `x`.
#[inline(always)]
unsafe fn sum_of_products(low: [int16x8_t; 2], high: [int16x8_t; 2], x: *const i16) -> Neon {
    // SAFETY: the caller's promise.
    unsafe {
        let four_sums = |low, high, x: *const i16| {
            let (x_low, x_high) = (vld1q_s16(x), vld1q_s16(x.add(16)));
            let first = vmull_s16(vget_low_s16(low), vget_low_s16(x_low));
            let first = vmlal_s16(first, vget_low_s16(high), vget_low_s16(x_high));
            let second = vmlal_high_s16(vmull_high_s16(low, x_low), high, x_high);
            vcvtq_f32_s32(vpaddq_s32(first, second))
        };
        Neon(four_sums(low[0], high[0], x), four_sums(low[1], high[1], x.add(8)))
    }
}

/// The sum of each four: first and third, second and fourth, then both.
///
/// # Safety
/// NEON.
#[inline(always)]
unsafe fn four_sums([a, b, c, d]: [float32x4_t; 4]) -> float32x4_t {
    // SAFETY: the caller's promise.
    unsafe {
        let twos = |one, other| {
            let (one, other) = (vreinterpretq_f64_f32(one), vreinterpretq_f64_f32(other));
            let first = vreinterpretq_f32_f64(vzip1q_f64(one, other));
            vaddq_f32(first, vreinterpretq_f32_f64(vzip2q_f64(one, other)))
        };
        vpaddq_f32(twos(a, b), twos(c, d))
    }
}
