//! The loops that take the time, each written once over [`Lanes`] and compiled
//! for plain Rust, for AVX2, for NEON and for WebAssembly's SIMD; which one runs is asked of
//! an x86-64 processor, and settled elsewhere when the program is built.
#![allow(unsafe_code)]

mod attention;
mod functions;
mod products;
mod vectors;

#[cfg(target_arch = "x86_64")]
use super::avx2::Avx2;
use super::lanes::Portable;
#[cfg(target_arch = "aarch64")]
use super::neon::Neon;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
use super::simd128::Simd128;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cpu(Kind);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "aarch64")]
    Neon,
    #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
    Simd128,
}

impl Cpu {
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("f16c")
        {
            return Self(Kind::Avx2);
        }
        #[cfg(target_arch = "aarch64")]
        return Self(Kind::Neon);
        #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
        return Self(Kind::Simd128);
        #[allow(unreachable_code)] // where the kind was settled above
        Self::portable()
    }

    /// Plain Rust, which runs everywhere and gives the same bits.
    pub fn portable() -> Self {
        Self(Kind::Portable)
    }

    pub fn name(self) -> &'static str {
        match self.0 {
            Kind::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 => "avx2",
            #[cfg(target_arch = "aarch64")]
            Kind::Neon => "neon",
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Kind::Simd128 => "simd128",
        }
    }
}

/// Makes `name(cpu, arguments)` out of a body over [`Lanes`].
macro_rules! kernel {
    ($(#[$doc:meta])* $name:ident = $module:ident::$body:ident$(::<$stored:ty>)?($($arg:ident: $type:ty),*)) => {
        $(#[$doc])*
        #[allow(clippy::too_many_arguments)]
        pub(crate) fn $name(cpu: Cpu, $($arg: $type),*) {
            match cpu.0 {
                Kind::Portable => $module::$body::<Portable $(, $stored)?>($($arg),*),
                #[cfg(target_arch = "aarch64")]
                Kind::Neon => $module::$body::<Neon $(, $stored)?>($($arg),*),
                #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
                Kind::Simd128 => $module::$body::<Simd128 $(, $stored)?>($($arg),*),
                #[cfg(target_arch = "x86_64")]
                Kind::Avx2 => {
                    #[target_feature(enable = "avx2,fma,f16c")]
                    fn compiled_for_it($($arg: $type),*) {
                        $module::$body::<Avx2 $(, $stored)?>($($arg),*)
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
    rows_f32 = products::rows::<f32>(out: &mut [f32], weights: &[f32], x: &[f32], width: usize)
}
kernel! {
    /// The same with rows of f16.
    rows_f16 = products::rows::<u16>(out: &mut [f32], weights: &[u16], x: &[f32], width: usize)
}
kernel! {
    /// The same with `q8_0` rows; `x` are integers with a scale per block, and
    /// rows of scales are `8 * width.div_ceil(256)` long.
    rows_q8 = products::rows_of_integers::<i8>(out: &mut [f32], weights: &[i8], scales: &[u16], x: &[i16], x_scales: &[f32], width: usize)
}
kernel! {
    /// The same with `q4_0` rows.
    rows_q4 = products::rows_of_integers::<u8>(out: &mut [f32], weights: &[u8], scales: &[u16], x: &[i16], x_scales: &[f32], width: usize)
}
kernel! {
    /// The same with rows of `q6` chunks.
    rows_q6 = products::rows_of_integers::<u16>(out: &mut [f32], weights: &[u16], scales: &[u16], x: &[i16], x_scales: &[f32], width: usize)
}
kernel! {
    /// Layer norm of `x` with scale and shift.
    norm = vectors::norm(out: &mut [f32], x: &[f32], weight: &[f32], bias: &[f32])
}
kernel! {
    /// Eq. 5 as a residual branch, in place: `x + scale * x / |x| * sqrt(dim)`.
    styled = vectors::styled(x: &mut [f32], scale: &[f32])
}
kernel! {
    /// Blocks of 32 as integers with a scale each.
    quantise = vectors::quantise(quants: &mut [i16], scales: &mut [f32], values: &[f32])
}
kernel! {
    /// The nearest f16 of each number.
    to_half = vectors::to_half(out: &mut [u16], values: &[f32])
}
kernel! {
    /// `x` to GELU(x), tanh form, in place.
    gelu = functions::gelu(x: &mut [f32])
}
kernel! {
    /// Scores of a query against rows of f32 keys, one for each score.
    scores_f32 = attention::scores::<f32>(scores: &mut [f32], keys: &[f32], query: &[f32])
}
kernel! {
    /// The same with keys in f16.
    scores_f16 = attention::scores::<u16>(scores: &mut [f32], keys: &[u16], query: &[f32])
}
kernel! {
    /// Takes `slope` times its age from each score: that of the first, one less
    /// for each further one.
    fade = functions::fade(scores: &mut [f32], slope: f32, age: f32)
}
kernel! {
    /// Scores to probabilities, in place.
    softmax = functions::softmax(scores: &mut [f32])
}
kernel! {
    /// Rows of f32 values, weighted and summed.
    mix_f32 = attention::mix::<f32>(out: &mut [f32], weights: &[f32], values: &[f32])
}
kernel! {
    /// The same with values in f16.
    mix_f16 = attention::mix::<u16>(out: &mut [f32], weights: &[f32], values: &[u16])
}
