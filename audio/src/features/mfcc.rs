//! MFCC, onset envelope and onset peak; assembles the 35 features of AIST++.
//!
//! Order: onset envelope 1, MFCC 20, chroma CENS 12, onset peak 1, beat 1 (set
//! by the analyzer). The definitions are those of librosa 0.11 at 10,240 Hz, hop
//! 512; here the stream has twice that rate and windows twice the samples, the
//! same in hertz and seconds. Differences, so that the features are causal:
//!
//! - Every window ends at the frame (look-back 200 ms): the onset envelope is
//!   librosa's (it shifts its centred frames by the same 100 ms), the MFCC are
//!   librosa's two frames later.
//! - Levels are relative to the loudest band so far, which fades by 6 dB a
//!   minute, in place of the maximum of the whole recording. That makes all
//!   features independent of gain, and leaves soft sections soft.
//! - Peaks use the running maximum and the mean of the last five frames.

use super::chroma_cens::ChromaCens;
use super::filter_bank::FilterBank;
use super::spectrum::{PowerSpectrum, SlidingWindow};
use servodance_types::SPECTRAL_DIM;

const MEL_BANDS: usize = 128;
const MFCC_COUNT: usize = 20;
const HIGHEST_HZ: f64 = 5120.0;
/// Samples of one window at the analysis rate: 200 ms.
const WINDOW: usize = 4096;
/// Power of the same tone in a window of 2048 samples at half the rate.
const POWER_SCALE: f32 = 0.25;
/// Bands this far below the reference count as silent.
const RANGE_DB: f32 = 80.0;
/// How fast the reference level fades.
const REFERENCE_FADE_DB: f32 = 0.1 / 20.0;
/// The reference never falls below this: about -75 dB of full scale, so that
/// the noise of an open microphone is not taken for music.
const REFERENCE_FLOOR_DB: f32 = -30.0;

/// Largest rise in one frame: bounds the step from silence to the first sound.
const ENVELOPE_LIMIT_DB: f32 = 20.0;

/// Unit of the onset envelope, decibels a frame.
const ENVELOPE_UNIT_DB: f32 = 5.0;
/// Unit of the first MFCC, which is the mean band level: 0 at -40 dB of the reference.
const LEVEL_UNIT_DB: f32 = 20.0;
/// Divisor of the other MFCC.
const MFCC_UNIT: f32 = 50.0;

const ENVELOPE: usize = 0;
const MFCC: usize = 1;
const CHROMA: usize = MFCC + MFCC_COUNT;
const PEAK: usize = CHROMA + 12;
/// Index of the beat mark in the feature vector.
pub(crate) const BEAT: usize = PEAK + 1;

pub(crate) struct SpectralFeatures {
    spectrum: PowerSpectrum,
    mel: FilterBank,
    power: [f32; MEL_BANDS],
    previous: [f32; MEL_BANDS],
    reference_db: f32,
    cosines: Vec<f32>,
    peaks: PeakPicker,
    cens: ChromaCens,
}

impl SpectralFeatures {
    pub(crate) fn new(rate_hz: u32) -> Self {
        let bin_hz = f64::from(rate_hz) / WINDOW as f64;
        // DCT-II with orthonormal scaling.
        let cosines = (0..MFCC_COUNT)
            .flat_map(|k| {
                let scale = (if k == 0 { 1.0 } else { 2.0 } / MEL_BANDS as f64).sqrt();
                (0..MEL_BANDS).map(move |n| {
                    let angle = std::f64::consts::PI * k as f64 * (n as f64 + 0.5);
                    (scale * (angle / MEL_BANDS as f64).cos()) as f32
                })
            })
            .collect();
        Self {
            spectrum: PowerSpectrum::new(WINDOW),
            mel: FilterBank::mel(MEL_BANDS, HIGHEST_HZ, bin_hz, WINDOW / 2 + 1),
            power: [0.0; MEL_BANDS],
            previous: [0.0; MEL_BANDS],
            reference_db: REFERENCE_FLOOR_DB,
            cosines,
            peaks: PeakPicker::default(),
            cens: ChromaCens::new(rate_hz),
        }
    }

    /// Newest samples that [`Self::frame`] reads.
    pub(crate) const LOOK_BACK: usize = WINDOW;

    /// Feeds the chroma, which resamples the stream to a lower rate.
    pub(crate) fn push(&mut self, sample: f32) {
        self.cens.push(sample);
    }

    /// The high-resolution magnitudes of the newest frame, 2.5 Hz a bin.
    pub(crate) fn fine_magnitude(&self) -> &[f32] {
        self.cens.magnitude()
    }

    /// The features at the end of `recent`; the beat mark stays 0.
    pub(crate) fn frame(&mut self, recent: &SlidingWindow) -> [f32; SPECTRAL_DIM] {
        let bins = self.spectrum.power(recent.newest(WINDOW));
        std::mem::swap(&mut self.power, &mut self.previous);
        self.mel.apply(bins, &mut self.power);
        self.power.iter_mut().for_each(|p| *p *= POWER_SCALE);

        let loudest = self.power.iter().fold(0.0f32, |m, &p| m.max(p));
        self.reference_db =
            (self.reference_db - REFERENCE_FADE_DB).max(decibels(loudest)).max(REFERENCE_FLOOR_DB);
        let floor = self.reference_db - RANGE_DB;
        let level = |p: f32| decibels(p).max(floor);

        let mut now = [0.0f32; MEL_BANDS];
        let mut rise = 0.0;
        for ((n, &power), &before) in now.iter_mut().zip(&self.power).zip(&self.previous) {
            *n = level(power);
            rise += (*n - level(before)).max(0.0);
        }
        let envelope_db = (rise / MEL_BANDS as f32).min(ENVELOPE_LIMIT_DB);

        let mut out = [0.0f32; SPECTRAL_DIM];
        out[ENVELOPE] = envelope_db / ENVELOPE_UNIT_DB;
        self.mfcc(&now, &mut out[MFCC..CHROMA]);
        self.cens.frame(&mut out[CHROMA..PEAK]);
        out[PEAK] = self.peaks.push(envelope_db);
        out
    }

    fn mfcc(&self, level_db: &[f32; MEL_BANDS], out: &mut [f32]) {
        for (k, value) in out.iter_mut().enumerate() {
            let row = &self.cosines[k * MEL_BANDS..(k + 1) * MEL_BANDS];
            let sum: f32 =
                row.iter().zip(level_db).map(|(c, db)| c * (db - self.reference_db)).sum();
            *value = if k == 0 {
                let mean_db = sum / (MEL_BANDS as f32).sqrt();
                (mean_db + RANGE_DB / 2.0) / LEVEL_UNIT_DB
            } else {
                sum / MFCC_UNIT
            };
        }
    }
}

/// The smooth spectrum that the MFCC of a frame describe: levels of `N` bands
/// evenly spaced in mel up to 5120 Hz, 0 (80 dB below the running reference) to 1.
pub fn bands<const N: usize>(spectral: &[f32; SPECTRAL_DIM]) -> [f32; N] {
    let scale = (2.0 / MEL_BANDS as f32).sqrt() * MFCC_UNIT;
    std::array::from_fn(|band| {
        let turn = std::f32::consts::PI * (band as f32 + 0.5) / N as f32;
        let shape: f32 =
            (1..MFCC_COUNT).map(|k| spectral[MFCC + k] * (turn * k as f32).cos()).sum();
        let below_db = spectral[MFCC] * LEVEL_UNIT_DB - RANGE_DB / 2.0 + scale * shape;
        (1.0 + below_db / RANGE_DB).clamp(0.0, 1.0)
    })
}

fn decibels(power: f32) -> f32 {
    10.0 * power.max(1e-10).log10()
}

/// One-sided onset peaks on the running scale of the envelope.
#[derive(Default)]
struct PeakPicker {
    recent: [f32; 5],
    maximum: f32,
}

impl PeakPicker {
    /// librosa's threshold over the local mean.
    const DELTA: f32 = 0.07;
    /// The maximum is forgotten with a time constant of 20 s.
    const FADE: f32 = 0.9975;

    fn push(&mut self, envelope_db: f32) -> f32 {
        self.recent.rotate_left(1);
        self.recent[4] = envelope_db;
        self.maximum = (self.maximum * Self::FADE).max(envelope_db);
        let mean = self.recent.iter().sum::<f32>() / 5.0;
        // Noise that rises by a fraction of a decibel is no onset.
        let high = envelope_db > mean + Self::DELTA * self.maximum && envelope_db > 0.3;
        let rising = envelope_db > self.recent[3];
        f32::from(u8::from(high && rising))
    }
}
