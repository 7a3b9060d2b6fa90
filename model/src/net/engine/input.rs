//! The vectors that matrices are multiplied with, one a lane: as they are for
//! f32 and f16 weights; in blocks of integers with a scale for quantised ones.
//!
//! 15 bits and a sign: the products with 8-bit weights still sum exactly, and
//! what is lost is lost in the weights alone.

use super::dtype::{BLOCK, Dtype};

/// The largest integer.
const LARGEST: f32 = 32_767.0;

/// Vectors of one width, filled up with zeros to whole blocks.
#[derive(Clone, Debug)]
pub(crate) struct Input {
    width: usize,
    lanes: usize,
    quantised: bool,
    pub values: Vec<f32>,
    pub quants: Vec<i16>,
    /// Per lane as many as [`scales_width`] says, the last ones 0.
    pub scales: Vec<f32>,
}

/// Numbers in a row filled up to whole blocks.
pub(crate) fn padded(width: usize) -> usize {
    width.next_multiple_of(BLOCK)
}

/// Scales kept for a row of this width: whole eights.
pub(crate) fn scales_width(width: usize) -> usize {
    8 * padded(width).div_ceil(8 * BLOCK)
}

impl Input {
    /// All zeros.
    pub fn new(width: usize, lanes: usize, dtype: Dtype) -> Self {
        let quantised = dtype.is_quantised();
        let if_quantised = |n| if quantised { n * lanes } else { 0 };
        Self {
            width,
            lanes,
            quantised,
            values: vec![0.0; padded(width) * lanes],
            quants: vec![0; if_quantised(padded(width))],
            scales: vec![0.0; if_quantised(scales_width(width))],
        }
    }

    /// How many vectors.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// Width filled up.
    pub fn padded(&self) -> usize {
        padded(self.width)
    }

    /// The numbers of one lane, to be written; then call [`Input::ready`].
    pub fn lane_mut(&mut self, lane: usize) -> &mut [f32] {
        let start = lane * self.padded();
        &mut self.values[start..start + self.width]
    }

    /// Takes the products of another matrix: row by row, in each row all lanes.
    pub fn take(&mut self, products: &[f32]) {
        let lanes = self.lanes;
        for lane in 0..lanes {
            let to = self.lane_mut(lane);
            match lanes {
                1 => to.copy_from_slice(products),
                _ => to
                    .iter_mut()
                    .zip(products[lane..].iter().step_by(lanes))
                    .for_each(|(to, from)| *to = *from),
            }
        }
        self.ready();
    }

    /// After the numbers were written.
    pub fn ready(&mut self) {
        if !self.quantised {
            return;
        }
        let (padded, scales) = (self.padded(), scales_width(self.width));
        for lane in 0..self.lanes {
            let values = self.values[lane * padded..][..padded]
                .as_chunks::<BLOCK>()
                .0;
            let quants = self.quants[lane * padded..][..padded]
                .as_chunks_mut::<BLOCK>()
                .0;
            let blocks = values.iter().zip(quants);
            for (scale, (values, quants)) in self.scales[lane * scales..].iter_mut().zip(blocks) {
                *scale = quantise(values, quants);
            }
        }
    }
}

/// Nearest integers of a block; gives their scale.
fn quantise(values: &[f32; BLOCK], quants: &mut [i16; BLOCK]) -> f32 {
    // 1.5 * 2^23: adding it leaves the nearest integer in the low bits.
    const ROUND: f32 = 12_582_912.0;
    let largest = values
        .iter()
        .fold(0f32, |m, v| if v.abs() > m { v.abs() } else { m });
    let inverse = if largest > f32::MIN_POSITIVE {
        LARGEST / largest
    } else {
        0.0
    };
    for (quant, value) in quants.iter_mut().zip(values) {
        *quant = (value * inverse + ROUND).to_bits() as i16;
    }
    largest / LARGEST
}
