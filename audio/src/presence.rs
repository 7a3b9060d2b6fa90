//! Is this music at all? Silence, speech, noise and machines are not.
//!
//! Two witnesses: the beat network, and how steady the tones are. Notes stay
//! where they are for a while, a voice glides, noise has no tones. Twenty times
//! a second; the answer is a running mean over some seconds, so that a break in
//! a song is not the end of the music. Free of gain; constant memory.

use crate::beats::network::sigmoid;
use servodance_types::FRAME_RATE_HZ;

/// Bins of the chroma's spectrum, 2.5 Hz each, that are looked at.
const FIRST_BIN: usize = 40;
const BINS: usize = 780;
/// Frames between the two spectra that are compared: 400 ms, their windows just
/// do not overlap.
const LAG: usize = 8;
/// Half the width of the neighbourhood above which a tone stands out, bins.
const REACH: usize = 12;
/// How fast the reference level falls in a frame: 2 dB a second.
const FADE: f32 = 0.988_6;

/// Weights of the network's log-odds and of the steadiness of tones, and their
/// sum for neither music nor not.
const NETWORK: f32 = 0.8;
const TONES: f32 = 6.4;
const NEITHER: f32 = 3.1;
/// Nothing is surer than this, log-odds.
const LIMIT: f32 = 4.0;
/// Time constant of the answer.
const MEMORY_S: f32 = 2.5;
/// Where it begins, log-odds.
const UNKNOWN: f32 = -1.0;

/// Compares the tones of now with those of 400 ms ago.
struct Steadiness {
    past: [[f32; BINS]; LAG],
    next: usize,
    reference: f32,
}

impl Steadiness {
    fn new() -> Self {
        Self {
            past: [[0.0; BINS]; LAG],
            next: 0,
            reference: 0.0,
        }
    }

    /// 0 nothing in common, 1 the same tones.
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
        let dot = |a: &[f32], b: &[f32]| crate::spectrum::dot(a, b);
        dot(&now, &before) / (dot(&now, &now) * dot(&before, &before)).sqrt().max(1e-6)
    }
}

/// What stands out of its neighbourhood, its mean taken away.
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

/// Whether there is music.
pub(crate) struct Presence {
    steadiness: Steadiness,
    /// Log-odds of music.
    odds: f32,
}

impl Presence {
    pub(crate) fn new() -> Self {
        Self {
            steadiness: Steadiness::new(),
            odds: UNKNOWN,
        }
    }

    /// One frame: the chroma's spectrum, and the network's log-odds, or `None`
    /// in silence.
    pub(crate) fn frame(&mut self, magnitude: &[f32], network: Option<f32>) {
        let steady = self.steadiness.frame(magnitude);
        let wish = network.map_or(-LIMIT, |odds| {
            let sum = NETWORK * odds.clamp(-6.0, 6.0) + TONES * steady - NEITHER;
            sum.clamp(-LIMIT, LIMIT)
        });
        self.odds += (wish - self.odds) / (MEMORY_S * FRAME_RATE_HZ as f32);
    }

    /// 0 surely no music, 1 surely music.
    pub(crate) fn value(&self) -> f32 {
        sigmoid(self.odds)
    }
}
