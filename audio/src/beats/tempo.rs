//! Which tempi the last seconds suggest: autocorrelation and a harmonic comb.
//!
//! Constant memory and the same work every hop.

/// Hops a second of the onset strength that tempi are counted in.
pub(crate) const RATE_HZ: f64 = 160.0;
/// Shortest period in hops: 192 BPM.
const SHORTEST: usize = 50;
/// Tempi: every whole number of hops down to 59 BPM, fastest first.
pub(crate) const TEMPI: usize = 113;

/// Middle and width of the bell of usual tempi.
const USUAL_BPM: f64 = 130.0;
const USUAL_OCTAVES: f64 = 0.63;
/// How far the best tempo stands out from the others.
const SHARPNESS: f32 = 3.2;
/// Periods that the comb looks at.
const TEETH: usize = 4;

/// The period of a tempo in hops.
pub(crate) const fn period(index: usize) -> usize {
    SHORTEST + index
}

/// A tempo in beats a minute.
pub(crate) fn bpm(index: usize) -> f64 {
    60.0 * RATE_HZ / period(index) as f64
}

/// What a stretch of onsets says of the tempo.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TempoFit {
    /// How likely each tempo is, prior included; sums to one.
    pub(crate) likelihood: [f32; TEMPI],
    /// How regular the onsets are: their autocorrelation at the best tempo,
    /// about 0.1 for speech and noise, above 0.2 for most music.
    pub(crate) clarity: f32,
}

/// The autocorrelation of the onset strength with exponential forgetting.
pub(crate) struct Tempogram {
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

    pub(crate) fn new() -> Self {
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

    /// How well each tempo fits what was heard lately.
    pub(crate) fn fit(&self) -> TempoFit {
        comb(&self.correlation, self.energy)
    }
}

/// Lags that the comb may look at, hops.
const fn longest_lag() -> usize {
    TEETH * period(TEMPI - 1) + 4
}

/// Sums the autocorrelation at multiples of each period.
fn comb(correlation: &[f32], energy: f32) -> TempoFit {
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
        *value = (*value / peak).powf(SHARPNESS) * prior_of(bpm(i)) + 1e-5;
        sum += *value;
    }
    fit.iter_mut().for_each(|v| *v /= sum);
    TempoFit {
        likelihood: fit,
        clarity: peak,
    }
}

fn at_lag(correlation: &[f32], lag: f64) -> f32 {
    let whole = (lag as usize).min(correlation.len() - 2);
    let part = (lag - whole as f64) as f32;
    let (a, b) = (correlation[whole], correlation[whole + 1]);
    a + part.min(1.0) * (b - a)
}

/// What tempi are usual: a bell over octaves.
pub(crate) fn prior_of(bpm: f64) -> f32 {
    let octaves = (bpm / USUAL_BPM).log2() / USUAL_OCTAVES;
    (-0.5 * octaves * octaves).exp() as f32
}
