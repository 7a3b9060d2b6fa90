//! Chroma energy normalised statistics (CENS), made causal.
//!
//! After Mueller and Ewert 2011 as in `librosa.feature.chroma_cens`: the energy
//! of the 12 pitch classes, made to sum to one, quantised on a logarithmic
//! scale, smoothed, and brought to unit length. Causal and cheap: a 400 ms
//! window over a slower stream in place of the constant-Q transform, tuning
//! fixed to A = 440 Hz, and the later half of librosa's 2 s Hann window turned
//! backwards (look-back 1.4 s in all).

use super::filter_bank::FilterBank;
use super::resampler::Resampler;
use super::spectrum::{PowerSpectrum, SlidingWindow};

const CLASSES: usize = 12;
const STREAM_RATE_HZ: u32 = 5120;
const WINDOW: usize = 2048;
/// Frames under the smoothing window: one second.
const SMOOTH: usize = 20;
/// Pitches below are not resolved by the window, above are mostly overtones.
const LOWEST_HZ: f32 = 110.0;
const HIGHEST_HZ: f32 = 2000.0;

pub(super) struct ChromaCens {
    resampler: Resampler,
    recent: SlidingWindow,
    spectrum: PowerSpectrum,
    classes: FilterBank,
    magnitude: Vec<f32>,
    history: [[f32; CLASSES]; SMOOTH],
    next: usize,
    smooth: [f32; SMOOTH],
}

impl ChromaCens {
    pub(super) fn new(rate_hz: u32) -> Self {
        let bin_hz = STREAM_RATE_HZ as f32 / WINDOW as f32;
        let mut smooth = [0.0; SMOOTH];
        for (age, weight) in smooth.iter_mut().enumerate() {
            let x = age as f32 / SMOOTH as f32;
            *weight = 0.5 + 0.5 * (std::f32::consts::PI * x).cos();
        }
        Self {
            resampler: Resampler::new(rate_hz, STREAM_RATE_HZ),
            recent: SlidingWindow::new(WINDOW),
            spectrum: PowerSpectrum::new(WINDOW),
            classes: FilterBank::from_weights(CLASSES, WINDOW / 2 + 1, |class, bin| {
                class_weight(class, bin as f32 * bin_hz)
            }),
            magnitude: vec![0.0; WINDOW / 2 + 1],
            history: [[0.0; CLASSES]; SMOOTH],
            next: 0,
            smooth,
        }
    }

    pub(super) fn push(&mut self, sample: f32) {
        let recent = &mut self.recent;
        self.resampler.push(sample, |s| recent.push(s));
    }

    /// Magnitudes of the newest frame, 2.5 Hz a bin.
    pub(super) fn magnitude(&self) -> &[f32] {
        &self.magnitude
    }

    /// Writes the 12 values (C first) of the frame that ends now.
    pub(super) fn frame(&mut self, out: &mut [f32]) {
        let power = self.spectrum.power(self.recent.newest(WINDOW));
        for (m, p) in self.magnitude.iter_mut().zip(power) {
            *m = p.sqrt();
        }
        let slot = &mut self.history[self.next];
        self.classes.apply(&self.magnitude, slot);
        quantise(slot);
        self.next = (self.next + 1) % SMOOTH;
        out.fill(0.0);
        for (age, weight) in self.smooth.iter().enumerate() {
            let old = &self.history[(self.next + SMOOTH - 1 - age) % SMOOTH];
            out.iter_mut().zip(old).for_each(|(o, h)| *o += weight * h);
        }
        let length = out.iter().map(|v| v * v).sum::<f32>().sqrt();
        if length > 1e-6 {
            out.iter_mut().for_each(|v| *v /= length);
        }
    }
}

/// Normalizes the sum to one and gives a quarter for each threshold exceeded.
fn quantise(classes: &mut [f32; CLASSES]) {
    let sum: f32 = classes.iter().sum();
    for value in classes {
        let share = if sum > 1e-4 { *value / sum } else { 0.0 };
        *value =
            [0.05, 0.1, 0.2, 0.4].iter().map(|&step| if share > step { 0.25 } else { 0.0 }).sum();
    }
}

/// Weight of a frequency in a pitch class: a bell a third of a semitone wide.
fn class_weight(class: usize, hz: f32) -> f32 {
    if !(LOWEST_HZ..HIGHEST_HZ).contains(&hz) {
        return 0.0;
    }
    let pitch = 69.0 + 12.0 * (hz / 440.0).log2() - class as f32;
    let off = pitch - 12.0 * (pitch / 12.0).round();
    let bell = (-0.5 * (off / 0.35) * (off / 0.35)).exp();
    if bell > 0.01 { bell / hz.sqrt() } else { 0.0 }
}
