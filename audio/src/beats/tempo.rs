//! Which tempi the last seconds suggest: autocorrelation and a harmonic comb.
//!
//! Constant memory and the same work every hop.

/// Tempi, slowest first, evenly spaced in octaves.
pub(crate) const TEMPI: usize = 80;
/// Range of the tempi in beats a minute.
const SLOWEST_BPM: f64 = 60.0;
const FASTEST_BPM: f64 = 190.0;

/// Periods that the comb looks at.
const TEETH: usize = 4;

/// The tempo of an index, beats a minute.
pub(crate) fn bpm(index: usize) -> f64 {
    SLOWEST_BPM * (FASTEST_BPM / SLOWEST_BPM).powf(index as f64 / (TEMPI - 1) as f64)
}

/// The autocorrelation of the onset strength with exponential forgetting.
pub(crate) struct Tempogram {
    rate_hz: f64,
    history: Vec<f32>,
    at: usize,
    correlation: Vec<f32>,
    keep: f32,
    mean: f32,
    energy: f32,
}

impl Tempogram {
    /// Time constant of the forgetting, seconds.
    const MEMORY_S: f64 = 6.0;

    pub(crate) fn new(rate_hz: f64) -> Self {
        let lags = longest_lag(rate_hz);
        Self {
            rate_hz,
            history: vec![0.0; lags],
            at: 0,
            correlation: vec![0.0; lags],
            keep: (-1.0 / (Self::MEMORY_S * rate_hz)).exp() as f32,
            mean: 0.0,
            energy: 0.0,
        }
    }

    pub(crate) fn push(&mut self, strength: f32) {
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

    /// How well each tempo fits, prior included; sums to one.
    pub(crate) fn likelihood(&self) -> [f32; TEMPI] {
        comb(&self.correlation, self.energy, self.rate_hz)
    }
}

/// How well each tempo fits a whole stretch of onsets; sums to one.
pub(crate) fn fits(onsets: &[f32], rate_hz: f64) -> [f32; TEMPI] {
    let mean = onsets.iter().sum::<f32>() / onsets.len().max(1) as f32;
    let level: Vec<f32> = onsets.iter().map(|v| v - mean).collect();
    let correlation: Vec<f32> = (0..longest_lag(rate_hz))
        .map(|lag| {
            let late = level.get(lag..).unwrap_or(&[]);
            late.iter().zip(&level).map(|(a, b)| a * b).sum()
        })
        .collect();
    comb(&correlation, correlation[0], rate_hz)
}

/// Lags that the comb may look at, hops.
fn longest_lag(rate_hz: f64) -> usize {
    (TEETH as f64 * 60.0 / SLOWEST_BPM * rate_hz) as usize + 4
}

/// Sums the autocorrelation at multiples of each period.
fn comb(correlation: &[f32], energy: f32, rate_hz: f64) -> [f32; TEMPI] {
    let mut fit = [0.0f32; TEMPI];
    for (i, value) in fit.iter_mut().enumerate() {
        let period = 60.0 / bpm(i) * rate_hz;
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
        *value = (*value / peak).powi(4) * prior_of(bpm(i)) + 1e-5;
        sum += *value;
    }
    fit.iter_mut().for_each(|v| *v /= sum);
    fit
}

fn at_lag(correlation: &[f32], lag: f64) -> f32 {
    let whole = (lag as usize).min(correlation.len() - 2);
    let part = (lag - whole as f64) as f32;
    let (a, b) = (correlation[whole], correlation[whole + 1]);
    a + part.min(1.0) * (b - a)
}

/// What tempi people tap: a bell over octaves around 120 BPM.
pub(crate) fn prior_of(bpm: f64) -> f32 {
    let octaves = (bpm / 118.0).log2() / 0.55;
    (-0.5 * octaves * octaves).exp() as f32
}
