//! A streaming resampler (rubato's windowed sinc) with a known delay.
//!
//! Output sample `n` is the input at `n / output_rate - delay_s` seconds and
//! depends only on input before `n / output_rate`: the delay makes the filter
//! causal. Work is done in whole chunks of output, so the same input gives the
//! same output whatever the block sizes; a chunk is handed out as soon as its
//! last input is there. Constant memory; `push` does not allocate.
//! [`Resampler::set_speed`] changes the ratio a little, for a source whose clock
//! drifts against ours.

use rubato::audioadapter_buffers::direct::SequentialSlice;
use rubato::{
    Adjustable, Async, FixedAsync, Resampler as _, SincInterpolationParameters,
    SincInterpolationType, WindowFunction,
};

/// Output samples of a chunk. Music frames and onset hops are whole chunks.
const CHUNK: usize = 64;

/// Largest change of the ratio by [`Resampler::set_speed`].
const MAX_BEND: f64 = 0.02;

/// Half the length of the filter, in samples of the slower rate.
const HALF_WIDTH: f64 = 16.0;

/// Points kept of the filter between two input samples.
const OVERSAMPLING: usize = 128;

/// Zeros in front of the input: the filter needs one sample beyond the time of
/// an output, and rounding may need another.
const HEAD: usize = 2;

/// Converts a mono stream from one rate to another.
pub struct Resampler {
    inner: Async<f32>,
    /// Input of the chunk that is being gathered.
    input: Vec<f32>,
    gathered: usize,
    needed: usize,
    output: [f32; CHUNK],
    delay_s: f64,
}

impl Resampler {
    /// A resampler between two rates in Hz, both above 0.
    pub fn new(input_rate: u32, output_rate: u32) -> Self {
        let (input_hz, output_hz) = (f64::from(input_rate), f64::from(output_rate));
        let ratio = output_hz / input_hz;
        // rubato takes multiples of eight.
        let sinc_len = ((2.0 * HALF_WIDTH / ratio.min(1.0)).ceil() as usize).next_multiple_of(8);
        let filter = SincInterpolationParameters {
            sinc_len,
            // Of the lower of the two Nyquist rates.
            f_cutoff: Some(0.94),
            oversampling_factor: OVERSAMPLING,
            interpolation: SincInterpolationType::Cubic,
            window: WindowFunction::Blackman,
        };
        let inner = Async::new_sinc(ratio, 1.0 + MAX_BEND, &filter, CHUNK, 1, FixedAsync::Output)
            .expect("two positive rates make a finite ratio");
        // rubato's first output is one output later than its first input, and
        // its filter is centred one kept point early.
        let centre = (sinc_len / 2 + HEAD) as f64 - 1.0 / OVERSAMPLING as f64;
        Self {
            input: vec![0.0; inner.input_frames_max()],
            gathered: HEAD,
            needed: inner.input_frames_next(),
            inner,
            output: [0.0; CHUNK],
            delay_s: (centre - 1.0 / ratio) / input_hz,
        }
    }

    /// Delay of the output against the input, seconds.
    pub fn delay_s(&self) -> f64 {
        self.delay_s
    }

    pub(crate) fn gathered(&self) -> usize {
        self.gathered
    }

    /// Plays the input faster (above 1) or slower by at most [`MAX_BEND`], from
    /// the next chunk on.
    pub(crate) fn set_speed(&mut self, speed: f64) {
        let speed = speed.clamp(1.0 - MAX_BEND / 2.0, 1.0 + MAX_BEND / 2.0);
        // A ratio within the bounds given at the start is never refused.
        let _ = self.inner.set_resample_ratio_relative(1.0 / speed, false);
        self.needed = self.inner.input_frames_next();
    }

    /// Takes one input sample and hands every output that it completes to `out`.
    pub fn push(&mut self, sample: f32, mut out: impl FnMut(f32)) {
        self.input[self.gathered] = sample;
        self.gathered += 1;
        while self.gathered >= self.needed {
            self.run();
            self.output.iter().for_each(|s| out(*s));
        }
    }

    fn run(&mut self) {
        let input = SequentialSlice::new(&self.input[..], 1, self.gathered);
        let output = SequentialSlice::new_mut(&mut self.output[..], 1, CHUNK);
        let done = match (input, output) {
            (Ok(input), Ok(mut output)) => {
                self.inner.process_into_buffer(&input, &mut output, None)
            }
            _ => unreachable!("the buffers have the lengths that were asked for"),
        };
        let used = done.map_or(self.needed, |(used, _)| used);
        self.input.copy_within(used..self.gathered, 0);
        self.gathered -= used;
        self.needed = self.inner.input_frames_next();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn convert(input: &[f32], from: u32, to: u32) -> (Vec<f32>, f64) {
        let mut resampler = Resampler::new(from, to);
        let mut out = Vec::new();
        for &sample in input {
            resampler.push(sample, |s| out.push(s));
        }
        (out, resampler.delay_s())
    }

    fn tone(hz: f64, rate: u32, seconds: f64) -> Vec<f32> {
        let length = (seconds * f64::from(rate)) as usize;
        (0..length).map(|i| (2.0 * PI * hz * i as f64 / f64::from(rate)).sin() as f32).collect()
    }

    #[test]
    fn tone_keeps_level_and_comes_after_the_delay() {
        for rate in [8_000, 11_025, 16_000, 20_480, 22_050, 44_100, 48_000, 96_000] {
            let (out, delay_s) = convert(&tone(700.0, rate, 0.2), rate, 20_480);
            let worst = (400..4000)
                .map(|n| {
                    let time_s = n as f64 / 20_480.0 - delay_s;
                    (f64::from(out[n]) - (2.0 * PI * 700.0 * time_s).sin()).abs()
                })
                .fold(0.0, f64::max);
            assert!(out.len() >= 4096, "{rate}: {}", out.len());
            assert!(worst < 2e-4, "{rate} Hz: error {worst}");
        }
    }

    #[test]
    fn tone_above_the_band_is_removed() {
        let (out, _) = convert(&tone(13_000.0, 48_000, 0.2), 48_000, 20_480);
        let worst = out[200..].iter().fold(0.0f32, |w, s| w.max(s.abs()));
        assert!(worst < 0.01, "alias of {worst}");
    }

    #[test]
    fn output_knows_only_earlier_input() {
        let mut input = vec![0.0; 4410];
        let (before, _) = convert(&input, 44_100, 20_480);
        input[2205] = 1.0; // at 0.05 s, output sample 1024
        let (after, _) = convert(&input, 44_100, 20_480);
        let first = before.iter().zip(&after).position(|(a, b)| a != b);
        assert!(first.is_some_and(|n| n >= 1024), "changed at {first:?}");
    }
}
