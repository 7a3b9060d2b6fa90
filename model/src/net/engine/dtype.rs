//! Number formats of packed weights, and blocks of 32 numbers in them.
//!
//! A quantised block has one f16 scale: `q8_0` keeps 32 integers from -127 to
//! 127, `q4_0` 32 from -8 to 7 in 16 bytes (the first 16 numbers in the low
//! halves). Both are of the kinds known under these names elsewhere.

use half::f16;
use serde::Serialize;

/// Numbers that share a scale.
pub(crate) const BLOCK: usize = 32;

/// How a weight is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Dtype {
    /// 32-bit floating point.
    F32,
    /// 16-bit floating point.
    F16,
    /// 8-bit integers, a scale for 32 of them: 8.5 bits a weight.
    #[serde(rename = "q8_0")]
    Q8_0,
    /// 4-bit integers, a scale for 32 of them: 4.5 bits a weight.
    #[serde(rename = "q4_0")]
    Q4_0,
}

impl Dtype {
    /// All formats, the widest first.
    pub const ALL: [Self; 4] = [Self::F32, Self::F16, Self::Q8_0, Self::Q4_0];

    /// Its name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F16 => "f16",
            Self::Q8_0 => "q8_0",
            Self::Q4_0 => "q4_0",
        }
    }

    /// Whether weights share a scale.
    pub const fn is_quantised(self) -> bool {
        matches!(self, Self::Q8_0 | Self::Q4_0)
    }
}

impl std::fmt::Display for Dtype {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Dtype {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|dtype| dtype.name() == name);
        found.ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("unknown number format `{name}`; choose one of: {names}")
        })
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
    let extreme = values
        .iter()
        .fold(0f32, |m, v| if v.abs() > m.abs() { *v } else { m });
    let tried = (0..=12).map(|i| f16::from_f32(extreme / -(7.0 + 0.125 * i as f32)));
    let errors = tried.map(|scale| (q4_error(values, scale), scale));
    let best = errors.min_by(|a, b| a.0.total_cmp(&b.0));
    let scale = best.map_or(f16::ZERO, |(_, scale)| scale);
    let quants = q4_quants(values, scale);
    let bytes = std::array::from_fn(|i| quants[i] | quants[i + BLOCK / 2] << 4);
    (bytes, scale)
}

/// The numbers of a `q4_0` block.
pub(crate) fn q4_values(bytes: &[u8], scale: f16) -> [f32; BLOCK] {
    let half = BLOCK / 2;
    let scale = scale.to_f32();
    std::array::from_fn(|i| {
        let nibble = if i < half {
            bytes[i] & 15
        } else {
            bytes[i - half] >> 4
        };
        (f32::from(nibble) - 8.0) * scale
    })
}

fn q4_quants(values: &[f32; BLOCK], scale: f16) -> [u8; BLOCK] {
    let inverse = inverse(scale);
    values.map(|v| (v * inverse + 8.0).round().clamp(0.0, 15.0) as u8)
}

fn q4_error(values: &[f32; BLOCK], scale: f16) -> f32 {
    let quants = q4_quants(values, scale);
    let back = quants.map(|q| (f32::from(q) - 8.0) * scale.to_f32());
    values.iter().zip(back).map(|(v, b)| (v - b).powi(2)).sum()
}

/// One over a scale; 0 where the block is all zeros.
fn inverse(scale: f16) -> f32 {
    match scale.to_f32() {
        0.0 => 0.0,
        scale => 1.0 / scale,
    }
}
