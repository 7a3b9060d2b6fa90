//! Tempogram: the likelihood of each tempo in the last seconds, from the
//! autocorrelation of the onset strength under a harmonic comb.
//!
//! Constant memory and the same work every hop.

use super::state_space::{RATE_HZ, TEMPI, period, prior};

/// Exponent by which the best tempo stands out from the others.
const SHARPNESS: f32 = 3.2;
/// Multiples of a period under the comb.
const TEETH: usize = 4;

#[derive(Clone, Copy, Debug)]
pub(super) struct TempogramFit {
    /// Likelihood of each tempo, prior included; sums to one.
    pub(super) likelihood: [f32; TEMPI],
    /// Regularity of the onsets: their autocorrelation at the best tempo,
    /// about 0.1 for speech and noise, above 0.2 for most music.
    pub(super) clarity: f32,
}

/// The autocorrelation of the onset strength with exponential forgetting.
pub(super) struct Tempogram {
    history: Vec<f32>,
    at: usize,
    correlation: Vec<f32>,
    keep: f32,
    mean: f32,
    energy: f32,
}

impl Tempogram {
    /// Time constant of the forgetting, seconds.
    const MEMORY_S: f64 = 7.5;

    pub(super) fn new() -> Self {
        let lags = longest_lag();
        Self {
            history: vec![0.0; lags],
            at: 0,
            correlation: vec![0.0; lags],
            keep: (-1.0 / (Self::MEMORY_S * RATE_HZ)).exp() as f32,
            mean: 0.0,
            energy: 0.0,
        }
    }

    pub(super) fn push(&mut self, strength: f32) {
        self.mean += (1.0 - self.keep) * (strength - self.mean);
        let now = strength - self.mean;
        self.energy = self.keep * self.energy + now * now;
        let lags = self.history.len();
        self.history[self.at] = now;
        let (new, old) = self.history.split_at(self.at + 1);
        // correlation[lag] pairs now with the value `lag` hops ago.
        let values = new.iter().rev().chain(old.iter().rev());
        for (c, h) in self.correlation.iter_mut().zip(values) {
            *c = self.keep * *c + now * h;
        }
        self.at = (self.at + 1) % lags;
    }

    pub(super) fn fit(&self) -> TempogramFit {
        comb(&self.correlation, self.energy)
    }
}

const fn longest_lag() -> usize {
    TEETH * period(TEMPI - 1) + 4
}

/// Sums the autocorrelation at multiples of each period.
fn comb(correlation: &[f32], energy: f32) -> TempogramFit {
    let mut fit = [0.0f32; TEMPI];
    for (i, value) in fit.iter_mut().enumerate() {
        let period = period(i) as f64;
        let (mut sum, mut weights) = (0.0, 0.0);
        for tooth in 1..=TEETH {
            let weight = 1.0 / tooth as f32;
            sum += weight * at_lag(correlation, period * tooth as f64);
            weights += weight;
        }
        *value = (sum / weights / (energy + 1e-3)).max(0.0);
    }
    let peak = fit.iter().fold(1e-6f32, |m, &v| m.max(v));
    let mut sum = 0.0;
    for (i, value) in fit.iter_mut().enumerate() {
        *value = (*value / peak).powf(SHARPNESS) * prior(i) + 1e-5;
        sum += *value;
    }
    fit.iter_mut().for_each(|v| *v /= sum);
    TempogramFit { likelihood: fit, clarity: peak }
}

fn at_lag(correlation: &[f32], lag: f64) -> f32 {
    let whole = (lag as usize).min(correlation.len() - 2);
    let part = (lag - whole as f64) as f32;
    let (a, b) = (correlation[whole], correlation[whole + 1]);
    a + part.min(1.0) * (b - a)
}
