//! Short-time spectra: a sliding buffer, a Hann window, a real FFT.
//!
//! Everything is allocated at the start; a transform allocates nothing.

use std::f64::consts::TAU;
use std::sync::Arc;

use realfft::num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

/// The newest samples of a stream, in one piece.
pub(crate) struct Sliding {
    data: Vec<f32>,
    end: usize,
    keep: usize,
}

impl Sliding {
    /// Keeps the newest `keep` samples; zeros at first.
    pub(crate) fn new(keep: usize) -> Self {
        Self {
            data: vec![0.0; 2 * keep],
            end: keep,
            keep,
        }
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

/// A Hann-windowed transform of fixed length.
pub(crate) struct Spectrum {
    window: Vec<f32>,
    plan: Arc<dyn RealToComplex<f32>>,
    input: Vec<f32>,
    output: Vec<Complex<f32>>,
    scratch: Vec<Complex<f32>>,
    power: Vec<f32>,
}

impl Spectrum {
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
            self.plan
                .process_with_scratch(&mut self.input, &mut self.output, &mut self.scratch);
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
    let rest: f32 = a_rows
        .remainder()
        .iter()
        .zip(b_rows.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a_rows.zip(b_rows) {
        for lane in 0..8 {
            lanes[lane] += x[lane] * y[lane];
        }
    }
    lanes.iter().sum::<f32>() + rest
}

/// A bank of filters over the bins of a spectrum, kept sparse.
pub(crate) struct FilterBank {
    /// First bin and weights of each filter.
    filters: Vec<(usize, Vec<f32>)>,
}

impl FilterBank {
    /// Mel bands after Slaney's Auditory Toolbox with area normalisation, as
    /// `librosa.filters.mel` makes them: linear below 1 kHz, then logarithmic.
    pub(crate) fn mel(bands: usize, highest_hz: f64, bin_hz: f64, bins: usize) -> Self {
        let top = hz_to_mel(highest_hz);
        let edge = |i: usize| mel_to_hz(top * i as f64 / (bands + 1) as f64);
        let filters = (0..bands)
            .map(|band| {
                let (low, middle, high) = (edge(band), edge(band + 1), edge(band + 2));
                let area = 2.0 / (high - low);
                dense_to_sparse((0..bins).map(|bin| {
                    let hz = bin as f64 * bin_hz;
                    let rise = (hz - low) / (middle - low);
                    let fall = (high - hz) / (high - middle);
                    (area * rise.min(fall).max(0.0)) as f32
                }))
            })
            .collect();
        Self { filters }
    }

    /// Filters from a weight for each pair of filter and bin.
    pub(crate) fn from_weights(
        count: usize,
        bins: usize,
        weight: impl Fn(usize, usize) -> f32,
    ) -> Self {
        let filters = (0..count)
            .map(|filter| dense_to_sparse((0..bins).map(|bin| weight(filter, bin))))
            .collect();
        Self { filters }
    }

    /// The sum of each filter over `bins`, into `out`.
    pub(crate) fn apply(&self, bins: &[f32], out: &mut [f32]) {
        for (value, (first, weights)) in out.iter_mut().zip(&self.filters) {
            *value = weights
                .iter()
                .zip(&bins[*first..])
                .map(|(w, b)| w * b)
                .sum();
        }
    }
}

fn dense_to_sparse(weights: impl Iterator<Item = f32>) -> (usize, Vec<f32>) {
    let dense: Vec<f32> = weights.collect();
    let first = dense.iter().position(|&w| w > 0.0).unwrap_or(0);
    let last = dense
        .iter()
        .rposition(|&w| w > 0.0)
        .map_or(first, |l| l + 1);
    (first, dense[first..last].to_vec())
}

const MEL_LINEAR_HZ: f64 = 200.0 / 3.0;
const MEL_LOG_START_HZ: f64 = 1000.0;

fn hz_to_mel(hz: f64) -> f64 {
    if hz < MEL_LOG_START_HZ {
        hz / MEL_LINEAR_HZ
    } else {
        MEL_LOG_START_HZ / MEL_LINEAR_HZ + (hz / MEL_LOG_START_HZ).ln() / (6.4f64.ln() / 27.0)
    }
}

fn mel_to_hz(mel: f64) -> f64 {
    let start = MEL_LOG_START_HZ / MEL_LINEAR_HZ;
    if mel < start {
        mel * MEL_LINEAR_HZ
    } else {
        MEL_LOG_START_HZ * ((mel - start) * 6.4f64.ln() / 27.0).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mel_scale_turns_back() {
        for hz in [50.0, 440.0, 999.0, 1001.0, 5000.0] {
            assert!((mel_to_hz(hz_to_mel(hz)) - hz).abs() < 1e-9 * hz);
        }
    }

    #[test]
    fn sliding_keeps_the_newest() {
        let mut sliding = Sliding::new(3);
        for i in 1..=10 {
            sliding.push(i as f32);
        }
        assert_eq!(sliding.newest(3), [8.0, 9.0, 10.0]);
    }
}
