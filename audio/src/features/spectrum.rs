//! Short-time power spectra: a sliding buffer, a Hann window, a real FFT, and
//! the two small functions that several users share.
//!
//! All memory is allocated by `new`; a transform allocates nothing.

use std::f64::consts::TAU;
use std::sync::Arc;

use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

/// The newest samples of a stream as one contiguous slice.
pub(crate) struct SlidingWindow {
    data: Vec<f32>,
    end: usize,
    keep: usize,
}

impl SlidingWindow {
    /// Keeps the newest `keep` samples; zeros at first.
    pub(crate) fn new(keep: usize) -> Self {
        Self { data: vec![0.0; 2 * keep], end: keep, keep }
    }

    pub(crate) fn push(&mut self, sample: f32) {
        if self.end == self.data.len() {
            self.data.copy_within(self.end - self.keep.., 0);
            self.end = self.keep;
        }
        self.data[self.end] = sample;
        self.end += 1;
    }

    /// The newest `count` samples, at most `keep`.
    pub(crate) fn newest(&self, count: usize) -> &[f32] {
        &self.data[self.end - count..self.end]
    }
}

pub(crate) struct PowerSpectrum {
    window: Vec<f32>,
    plan: Arc<dyn RealToComplex<f32>>,
    input: Vec<f32>,
    output: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
    power: Vec<f32>,
}

impl PowerSpectrum {
    pub(crate) fn new(length: usize) -> Self {
        let plan = RealFftPlanner::<f32>::new().plan_fft_forward(length);
        // The periodic Hann window, as librosa takes it.
        let window = (0..length)
            .map(|i| (0.5 - 0.5 * (TAU * i as f64 / length as f64).cos()) as f32)
            .collect();
        Self {
            window,
            input: plan.make_input_vec(),
            output: plan.make_output_vec(),
            scratch: plan.make_scratch_vec(),
            power: vec![0.0; length / 2 + 1],
            plan,
        }
    }

    /// The power of each bin of `samples`, which must be of the right length.
    pub(crate) fn power(&mut self, samples: &[f32]) -> &[f32] {
        for ((i, s), w) in self.input.iter_mut().zip(samples).zip(&self.window) {
            *i = s * w;
        }
        // Lengths are equal by construction, the one error that there is.
        let done =
            self.plan.process_with_scratch(&mut self.input, &mut self.output, &mut self.scratch);
        debug_assert!(done.is_ok());
        for (p, c) in self.power.iter_mut().zip(&self.output) {
            *p = c.norm_sqr();
        }
        &self.power
    }
}

/// The scalar product in eight lanes, which the compiler turns into vectors.
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0f32; 8];
    let (a_rows, b_rows) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f32 = a_rows.remainder().iter().zip(b_rows.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a_rows.zip(b_rows) {
        for lane in 0..8 {
            lanes[lane] += x[lane] * y[lane];
        }
    }
    lanes.iter().sum::<f32>() + rest
}

pub(crate) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sliding_keeps_the_newest() {
        let mut sliding = SlidingWindow::new(3);
        for i in 1..=10 {
            sliding.push(i as f32);
        }
        assert_eq!(sliding.newest(3), [8.0, 9.0, 10.0]);
    }
}
