//! Detects music, as opposed to silence, speech, noise and machines.
//!
//! Three inputs: the music output of the beat network, the steadiness of tones, and the
//! beats. Notes keep their pitch for a while, a voice glides, noise has no tones; drums
//! alone have beats. The result is a running mean over [`MEMORY_S`], so that a break in a
//! song is not the end of the music. Independent of gain; constant memory.

use super::spectrum::{dot, sigmoid};
use servodance_types::FRAME_RATE_HZ;

/// Bins of the chroma's spectrum that count, 2.5 Hz each.
const FIRST_BIN: usize = 40;
const BINS: usize = 780;
/// Frames between the two spectra that are compared: 400 ms, just without overlap.
const LAG: usize = 8;
/// Half the width of the neighbourhood above which a tone stands out, bins.
const REACH: usize = 12;
/// How fast the reference level falls in a frame: 2 dB a second.
const FADE: f32 = 0.988_6;

/// Logistic weights of the network's log-odds, of the steadiness of tones, of the beats
/// above those that are heard in anything, and the bias. The network is sure of music, but
/// also of some talkers: the steadiness has the last word.
const NETWORK: f32 = 0.2;
const NETWORK_RANGE: (f32, f32) = (-4.0, 8.0);
const TONES: f32 = 7.0;
const BEATS: f32 = 20.0;
const ANY_BEATS: f32 = 0.1;
const BIAS: f32 = 3.3;
/// Bound of the log-odds either way.
const LIMIT: f32 = 4.0;
/// Time constant of the running mean.
const MEMORY_S: f32 = 2.5;
const UNKNOWN: f32 = -1.0;

/// Compares the tones of a frame with those of [`LAG_S`](MusicDetector::LAG_S) before.
struct ToneSteadiness {
    past: [[f32; BINS]; LAG],
    next: usize,
    reference: f32,
}

impl ToneSteadiness {
    fn new() -> Self {
        Self { past: [[0.0; BINS]; LAG], next: 0, reference: 0.0 }
    }

    /// Correlation of the tones: 0 nothing in common, 1 the same.
    fn frame(&mut self, magnitude: &[f32]) -> f32 {
        let bins = &magnitude[FIRST_BIN..FIRST_BIN + BINS];
        let loudest = bins.iter().fold(0.0f32, |m, &v| m.max(v));
        self.reference = (self.reference * FADE).max(loudest).max(1e-3);
        let scale = 1000.0 / self.reference;
        let mut level = [0.0f32; BINS];
        for (l, m) in level.iter_mut().zip(bins) {
            *l = (1.0 + scale * m).ln();
        }
        let now = tones(&level);
        let before = std::mem::replace(&mut self.past[self.next], now);
        self.next = (self.next + 1) % LAG;
        dot(&now, &before) / (dot(&now, &now) * dot(&before, &before)).sqrt().max(1e-6)
    }
}

/// The spectrum above its neighbourhood, with zero mean.
fn tones(level: &[f32; BINS]) -> [f32; BINS] {
    let mut out = [0.0; BINS];
    // The sum over the neighbourhood, as far as there is one.
    let mut sum: f32 = level[..REACH].iter().sum();
    for (bin, value) in out.iter_mut().enumerate() {
        sum += level.get(bin + REACH).copied().unwrap_or(0.0);
        if bin > REACH {
            sum -= level[bin - REACH - 1];
        }
        let count = (bin + REACH).min(BINS - 1) - bin.saturating_sub(REACH) + 1;
        *value = (level[bin] - sum / count as f32).max(0.0);
    }
    let mean = out.iter().sum::<f32>() / BINS as f32;
    out.iter_mut().for_each(|v| *v -= mean);
    out
}

pub(crate) struct MusicDetector {
    steadiness: ToneSteadiness,
    odds: f32,
}

impl MusicDetector {
    /// Between the two spectra whose tones are compared.
    pub(crate) const LAG_S: f64 = LAG as f64 / FRAME_RATE_HZ;

    pub(crate) fn new() -> Self {
        Self { steadiness: ToneSteadiness::new(), odds: UNKNOWN }
    }

    /// Takes the chroma's magnitudes, the network's log-odds (`None` in silence), and how
    /// surely it hears beats where the tracker has them, 0 to 1. How steady the tones are,
    /// -1 to 1.
    pub(crate) fn frame(&mut self, magnitude: &[f32], network: Option<f32>, beats: f32) -> f32 {
        let steady = self.steadiness.frame(magnitude);
        let target = network.map_or(-LIMIT, |odds| {
            let heard = NETWORK * odds.clamp(NETWORK_RANGE.0, NETWORK_RANGE.1);
            let sum = heard + TONES * steady + BEATS * (beats - ANY_BEATS).max(0.0) - BIAS;
            sum.clamp(-LIMIT, LIMIT)
        });
        self.odds += (target - self.odds) / (MEMORY_S * FRAME_RATE_HZ as f32);
        steady
    }

    /// Probability of music, 0 to 1.
    pub(crate) fn presence(&self) -> f32 {
        sigmoid(self.odds)
    }
}
