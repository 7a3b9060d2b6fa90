//! The vectors that matrices are multiplied with, one a lane: as they are for
//! f32 and f16 weights; in blocks of integers with a scale for quantised ones.
//!
//! 15 bits and a sign: the products with 8-bit weights still sum exactly, and
//! what is lost is lost in the weights alone.

use super::kernels::{self, Cpu};
use crate::weights::{Dtype, padded, scales_width};

/// Vectors of one width, filled up with zeros to whole blocks.
#[derive(Clone, Debug)]
pub(crate) struct Input {
    width: usize,
    lanes: usize,
    dtype: Dtype,
    pub values: Vec<f32>,
    pub quants: Vec<i16>,
    /// Per lane as many as [`scales_width`] says, the last ones 0.
    pub scales: Vec<f32>,
}

impl Input {
    pub fn new(width: usize, lanes: usize, dtype: Dtype) -> Self {
        let if_quantised = |n| if dtype.is_quantised() { n * lanes } else { 0 };
        let padded = padded(width, dtype);
        Self {
            width,
            lanes,
            dtype,
            values: vec![0.0; padded * lanes],
            quants: vec![0; if_quantised(padded)],
            scales: vec![0.0; if_quantised(scales_width(width))],
        }
    }

    pub fn lanes(&self) -> usize {
        self.lanes
    }

    pub fn padded(&self) -> usize {
        padded(self.width, self.dtype)
    }

    /// The numbers of one lane, to be written; then call [`Input::ready`].
    pub fn lane_mut(&mut self, lane: usize) -> &mut [f32] {
        let start = lane * self.padded();
        &mut self.values[start..start + self.width]
    }

    /// Takes the products of another matrix: row by row, in each row all lanes.
    pub fn take(&mut self, cpu: Cpu, products: &[f32]) {
        let lanes = self.lanes;
        for lane in 0..lanes {
            copy_lane(self.lane_mut(lane), products, lane, lanes);
        }
        self.ready(cpu);
    }

    pub fn ready(&mut self, cpu: Cpu) {
        if !self.dtype.is_quantised() {
            return;
        }
        let padded = self.padded();
        let scales = self.scales.chunks_exact_mut(scales_width(self.width));
        let quants = self.quants.chunks_exact_mut(padded);
        let values = self.values.chunks_exact(padded);
        for (scales, (quants, values)) in scales.zip(quants.zip(values)) {
            kernels::quantise(cpu, quants, scales, values);
        }
    }
}

/// Copies one lane out of products: output by output, of each all lanes.
pub(crate) fn copy_lane(to: &mut [f32], products: &[f32], lane: usize, lanes: usize) {
    match lanes {
        1 => to.copy_from_slice(&products[..to.len()]),
        _ => to
            .iter_mut()
            .zip(products[lane..].iter().step_by(lanes))
            .for_each(|(to, from)| *to = *from),
    }
}

/// Adds one lane of products to a vector.
pub(crate) fn add_lane(x: &mut [f32], products: &[f32], lane: usize, lanes: usize) {
    match lanes {
        1 => x.iter_mut().zip(products).for_each(|(x, p)| *x += p),
        _ => x.iter_mut().zip(products[lane..].iter().step_by(lanes)).for_each(|(x, p)| *x += p),
    }
}
