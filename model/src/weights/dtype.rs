//! Number formats of packed weights, and blocks of 32 numbers in them.
//!
//! A quantised block has one f16 scale: `q8_0` keeps 32 integers from -127 to
//! 127, `q4_0` 32 from -8 to 7 in 16 bytes (the first 16 numbers in the low
//! halves). Both are of the kinds known under these names elsewhere.
//!
//! `q6` is our own: integers from -32 to 31, four blocks in a chunk of 48 words
//! of 16 bits, from which sixteen at a time are taken by shifts alone. Word i of
//! the first sixteen holds numbers i (lowest bits) and 16 + i of the chunk, of
//! the second sixteen 32 + i and 48 + i, of the third 64 + i and 80 + i. Number
//! 96 + i has its upper four bits on top of the first word and its lower two in
//! bits 12 and 13 of the second; 112 + i on top of the third, and in bits 14
//! and 15 of the second.

use half::f16;
use serde::Serialize;
use servodance_types::named;

/// Numbers that share a scale.
pub(crate) const BLOCK: usize = 32;
/// Numbers of a `q6` chunk.
pub(crate) const CHUNK: usize = 4 * BLOCK;
/// Words of 16 bits that hold them.
pub(crate) const CHUNK_WORDS: usize = 48;

/// How a weight is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Dtype {
    /// 32-bit floating point: 32 bits a weight.
    F32,
    /// 16-bit floating point: 16 bits a weight.
    F16,
    /// 8-bit integers, a scale for 32 of them: 8.5 bits a weight.
    #[serde(rename = "q8_0")]
    Q8_0,
    /// 6-bit integers, a scale for 32 of them: 6.5 bits a weight.
    #[serde(rename = "q6")]
    Q6,
    /// 4-bit integers, a scale for 32 of them: 4.5 bits a weight.
    #[serde(rename = "q4_0")]
    Q4_0,
}

named!(Dtype, "number format" {
    F32 "f32", F16 "f16", Q8_0 "q8_0", Q6 "q6", Q4_0 "q4_0"
});

impl Dtype {
    /// Whether weights share a scale.
    pub const fn is_quantised(self) -> bool {
        matches!(self, Self::Q8_0 | Self::Q6 | Self::Q4_0)
    }

    /// Numbers that rows are filled up to whole multiples of.
    pub(crate) const fn chunk(self) -> usize {
        match self {
            Self::Q6 => CHUNK,
            _ => BLOCK,
        }
    }
}

/// Integers and scale of a block in `q8_0`.
pub(crate) fn q8_block(values: &[f32; BLOCK]) -> ([i8; BLOCK], f16) {
    let largest = values.iter().fold(0f32, |m, v| m.max(v.abs()));
    let scale = f16::from_f32(largest / 127.0);
    let inverse = inverse(scale);
    let quants = values.map(|v| (v * inverse).round().clamp(-127.0, 127.0) as i8);
    (quants, scale)
}

/// Bytes and scale of a block in `q4_0`: of some scales near the largest
/// number's the one with the least squared error.
pub(crate) fn q4_block(values: &[f32; BLOCK]) -> ([u8; BLOCK / 2], f16) {
    let tried = |i| -(7.0 + 0.125 * i as f32);
    let (quants, scale) = best_of(values, (0..=12).map(tried), 8);
    let quants = quants.map(|q| (q + 8) as u8);
    let bytes = std::array::from_fn(|i| quants[i] | quants[i + BLOCK / 2] << 4);
    (bytes, scale)
}

/// The numbers of a `q4_0` block.
pub(crate) fn q4_values(bytes: &[u8], scale: f16) -> [f32; BLOCK] {
    let half = BLOCK / 2;
    let scale = scale.to_f32();
    std::array::from_fn(|i| {
        let nibble = if i < half { bytes[i] & 15 } else { bytes[i - half] >> 4 };
        (f32::from(nibble) - 8.0) * scale
    })
}

/// Integers from `-half` to `half - 1` and a scale: of those that make the
/// number farthest from 0 one of `wanted`, the one with the least squared error.
fn best_of(
    values: &[f32; BLOCK],
    wanted: impl Iterator<Item = f32>,
    half: i8,
) -> ([i8; BLOCK], f16) {
    let farther = |m: f32, v: &f32| if v.abs() > m.abs() { *v } else { m };
    let extreme = values.iter().fold(0f32, farther);
    let quants = |scale: f16| {
        let (low, high) = (f32::from(-half), f32::from(half - 1));
        values.map(|v| (v * inverse(scale)).round().clamp(low, high) as i8)
    };
    let error = |scale: f16| -> f32 {
        let back = quants(scale).map(|q| f32::from(q) * scale.to_f32());
        values.iter().zip(back).map(|(v, b)| (v - b).powi(2)).sum()
    };
    let errors = wanted.map(|wanted| {
        let scale = f16::from_f32(extreme / wanted);
        (error(scale), scale)
    });
    let best = errors.min_by(|a, b| a.0.total_cmp(&b.0));
    let scale = best.map_or(f16::ZERO, |(_, scale)| scale);
    (quants(scale), scale)
}

/// Words and scales of a chunk in `q6`.
pub(crate) fn q6_chunk(values: &[f32; CHUNK]) -> ([u16; CHUNK_WORDS], [f16; 4]) {
    let tried = |i| -(31.0 + 0.25 * i as f32);
    let mut quants = [0; CHUNK];
    let mut scales = [f16::ZERO; 4];
    let blocks = quants.as_chunks_mut::<BLOCK>().0.iter_mut().zip(&mut scales);
    for ((quants, scale), values) in blocks.zip(values.as_chunks::<BLOCK>().0) {
        (*quants, *scale) = best_of(values, (0..=6).map(tried), 32);
    }
    let bits = |n: usize| (quants[n] & 63) as u16;
    let words = std::array::from_fn(|word| {
        let (third, i) = (word / 16, word % 16);
        let two = bits(32 * third + i) | bits(32 * third + 16 + i) << 6;
        let (sixth, last) = (bits(96 + i), bits(112 + i));
        two | match third {
            0 => sixth >> 2 << 12,
            1 => (sixth & 3) << 12 | (last & 3) << 14,
            _ => last >> 2 << 12,
        }
    });
    (words, scales)
}

/// An integer of a `q6` chunk.
#[inline(always)]
pub(crate) fn q6_quant(words: &[u16; CHUNK_WORDS], n: usize) -> i16 {
    let (sixteen, i) = (n / 16, n % 16);
    // The six bits on top, to be brought down with their sign.
    let top = match sixteen {
        6 => words[i] & 0xf000 | words[16 + i] >> 2 & 0x0c00,
        7 => words[32 + i] & 0xf000 | words[16 + i] >> 4 & 0x0c00,
        _ => words[sixteen / 2 * 16 + i] << if sixteen % 2 == 0 { 10 } else { 4 },
    };
    top as i16 >> 10
}

/// The numbers of a `q6` chunk.
pub(crate) fn q6_values(words: &[u16; CHUNK_WORDS], scales: [f16; 4]) -> [f32; CHUNK] {
    std::array::from_fn(|n| f32::from(q6_quant(words, n)) * scales[n / BLOCK].to_f32())
}

/// One over a scale; 0 where the block is all zeros.
fn inverse(scale: f16) -> f32 {
    match scale.to_f32() {
        0.0 => 0.0,
        scale => 1.0 / scale,
    }
}
