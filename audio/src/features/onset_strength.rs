//! Onset strength 160 times a second: multi-band logarithmic spectral flux.
//!
//! Each band's rise over the last 12.5 ms, above the loudest neighbour of that
//! time (Boeck and Widmer's SuperFlux, 2013), on a logarithmic scale relative
//! to the running level. Low, middle and high bands are brought to equal
//! strength and added, so that a kick counts as much as a cymbal. Causal; the
//! peak of an onset comes [`LATENCY_S`] after it is audible.

use super::filter_bank::FilterBank;
use super::spectrum::{PowerSpectrum, SlidingWindow};

/// Samples between two values.
pub(crate) const HOP: usize = 128;
/// Samples of one window: 50 ms.
const WINDOW: usize = 1024;
/// Bands, from `LOWEST_HZ` up, four an octave.
pub(crate) const BANDS: usize = 32;
const LOWEST_HZ: f32 = 40.0;
/// Hops between the two spectra that are compared.
const LAG: usize = 2;
/// First bands of the groups: below 160 Hz, up to 800 Hz, up to 3 kHz, above.
const GROUPS: [usize; 5] = [0, 8, 17, 25, BANDS];
const GROUP_WEIGHTS: [f32; 4] = [1.1, 0.5, 0.25, 0.5];
/// How much louder than this share of the reference a band must be to count.
const COMPRESSION: f32 = 100.0;
/// From an audible onset to the peak of its strength; measured on clicks and
/// rendered drums, without the resampler's delay.
pub(crate) const LATENCY_S: f64 = 0.019;

pub(crate) struct OnsetDetector {
    spectrum: PowerSpectrum,
    bands: FilterBank,
    /// Compressed band levels of the last hops, newest first.
    levels: [[f32; BANDS]; LAG + 1],
    reference: f32,
    scales: [FluxNormalizer; 4],
}

/// Onset strength of one hop and the band values that the beat network reads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Onset {
    /// Onset strength: 0 none, about 1 for a typical onset of this music.
    pub(crate) strength: f32,
    /// Whether the hop is louder than -70 dB of full scale.
    pub(crate) audible: bool,
    /// Strength of each group of bands, lowest first, on the same scale.
    pub(crate) groups: [f32; 4],
    /// Rise of each band over its neighbourhood, logarithmic.
    pub(crate) rises: [f32; BANDS],
    pub(crate) levels: [f32; BANDS / 2],
}

impl OnsetDetector {
    pub(crate) const LOOK_BACK: usize = WINDOW;

    pub(crate) fn new(rate_hz: u32) -> Self {
        let bin_hz = rate_hz as f32 / WINDOW as f32;
        let bins = WINDOW / 2 + 1;
        Self {
            spectrum: PowerSpectrum::new(WINDOW),
            bands: FilterBank::from_weights(BANDS, bins, |band, bin| {
                let octave = (bin as f32 * bin_hz / LOWEST_HZ).max(1e-3).log2();
                // Triangles in octaves, at least one bin wide.
                let width = 0.25f32.max(bin_hz / (LOWEST_HZ * (band as f32 / 4.0).exp2()));
                (1.0 - (octave - band as f32 / 4.0).abs() / width).max(0.0)
            }),
            levels: [[0.0; BANDS]; LAG + 1],
            reference: 0.0,
            scales: [FluxNormalizer::default(); 4],
        }
    }

    pub(crate) fn hop(&mut self, recent: &SlidingWindow) -> Onset {
        let power = self.spectrum.power(recent.newest(WINDOW));
        self.levels.rotate_right(1);
        let now = &mut self.levels[0];
        self.bands.apply(power, now);
        let loudest = now.iter().fold(0.0f32, |m, &p| m.max(p)).sqrt();
        // About -70 dB of full scale: the threshold of silence.
        let audible = loudest > 0.08;
        // The reference falls by 2 dB a second.
        self.reference = (self.reference * 0.998_56).max(loudest).max(0.08);
        for level in now.iter_mut() {
            *level = (1.0 + COMPRESSION * level.sqrt() / self.reference).ln();
        }
        let before = &self.levels[LAG];
        let now = &self.levels[0];
        let mut strength = 0.0;
        let mut rises = [0.0; BANDS];
        let mut groups = [0.0; 4];
        for (group, scale) in self.scales.iter_mut().enumerate() {
            let mut rise = 0.0;
            for band in GROUPS[group]..GROUPS[group + 1] {
                let low = before[band.saturating_sub(1)];
                let high = before[(band + 1).min(BANDS - 1)];
                rises[band] = (now[band] - before[band].max(low).max(high)).max(0.0);
                rise += rises[band];
            }
            groups[group] = scale.normalise(rise);
            strength += GROUP_WEIGHTS[group] * groups[group];
        }
        Onset {
            strength,
            audible,
            groups,
            rises,
            levels: std::array::from_fn(|pair| 0.5 * (now[2 * pair] + now[2 * pair + 1])),
        }
    }
}

/// Brings a flux to a mean square of one over the last seconds.
#[derive(Clone, Copy, Debug, Default)]
struct FluxNormalizer {
    mean: f32,
    square: f32,
}

impl FluxNormalizer {
    /// Time constants: 0.4 s for what is usual, 6 s for what is strong.
    const MEAN_POLE: f32 = 1.0 / (0.4 * 160.0);
    const SQUARE_POLE: f32 = 1.0 / (6.0 * 160.0);
    /// Below this root mean square a group is silent and stays so.
    const FLOOR: f32 = 0.15;

    fn normalise(&mut self, value: f32) -> f32 {
        let above = (value - self.mean).max(0.0);
        self.mean += Self::MEAN_POLE * (value - self.mean);
        self.square += Self::SQUARE_POLE * (above * above - self.square);
        // A single great peak should not outweigh a bar of others.
        (above / self.square.sqrt().max(Self::FLOOR)).min(6.0) / 6.0
    }
}
