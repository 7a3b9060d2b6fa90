//! A belief over tempo and phase, updated at every hop (a bar-pointer model
//! with one-beat bars; Whiteley 2006, efficient state space after Krebs 2015).
//!
//! Each tempo has one state for every hop of its period: hops since the last
//! beat. Time moves all of them on by one, which costs nothing in a ring; only
//! the states near a beat are reweighted by what was heard. At a beat the tempo
//! may change a little; now and then belief is lent to the tempi that the
//! tempogram suggests, so that a new song is found soon. Constant memory.

use super::tempo::{RATE_HZ, TEMPI, bpm, period, prior_of};

/// Width of the bell around a beat in which onsets count, seconds, and its half
/// length in hops.
const BEAT_SIGMA_S: f32 = 0.017;
const BELL: usize = 6;
/// Weight of an onset's strength in the log-likelihood of a beat.
const GAIN: f32 = 2.1;
/// Strength that is neither for nor against a beat.
const NEUTRAL: f32 = 0.07;
/// How fast the chance of a change of tempo falls with its relative size.
const STEADINESS: f32 = 120.0;
/// Furthest change of the period at one beat, hops.
const REACH: usize = 3;
/// Belief lent to the tempogram's suggestion in one second.
const LEND_PER_S: f32 = 0.03;
/// Weights of the usual tempi and of the tempogram: log-belief a second.
const USUAL_PER_S: f32 = 0.24;
const FITTING_PER_S: f32 = 0.22;

/// One tempo's states: a ring of hops since the last beat.
struct Ring {
    states: Vec<f32>,
    /// Where the state "on the beat now" is.
    zero: usize,
}

impl Ring {
    fn at(&self, since_beat: usize) -> usize {
        let at = self.zero + since_beat;
        if at < self.states.len() {
            at
        } else {
            at - self.states.len()
        }
    }

    fn total(&self) -> f32 {
        self.states.iter().sum()
    }
}

/// What is believed of tempo and phase.
pub(crate) struct Belief {
    rings: Vec<Ring>,
    /// The bell around a beat, by distance in hops.
    bell: [f32; BELL],
    /// Chances of the steps from each tempo to its neighbours.
    steps: Vec<[f32; 2 * REACH + 1]>,
}

/// The most believed tempo and phase.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Estimate {
    /// Beats a minute.
    pub(crate) bpm: f64,
    /// Beats since the last beat, 0 to 1.
    pub(crate) phase: f64,
    /// Belief in this tempo and phase and their near neighbours, 0 to 1.
    pub(crate) mass: f32,
}

impl Belief {
    pub(crate) fn new() -> Self {
        let prior: Vec<f32> = (0..TEMPI).map(|i| prior_of(bpm(i))).collect();
        let sum: f32 = prior.iter().sum();
        let rings = (0..TEMPI)
            .map(|i| {
                let period = period(i);
                Ring {
                    states: vec![prior[i] / sum / period as f32; period],
                    zero: 0,
                }
            })
            .collect();
        let bell = std::array::from_fn(|hop| {
            let x = hop as f32 / RATE_HZ as f32 / BEAT_SIGMA_S;
            (-0.5 * x * x).exp()
        });
        let steps = (0..TEMPI)
            .map(|from| {
                let mut chances: [f32; 2 * REACH + 1] = std::array::from_fn(|k| {
                    let change = (k as f32 - REACH as f32).abs() / period(from) as f32;
                    (-STEADINESS * change).exp()
                });
                let sum: f32 = chances.iter().sum();
                chances.iter_mut().for_each(|c| *c /= sum);
                chances
            })
            .collect();
        Self { steps, rings, bell }
    }

    /// Moves on by one hop in which `strength` was heard.
    pub(crate) fn hop(&mut self, strength: f32) {
        self.advance();
        self.weigh(strength);
    }

    fn advance(&mut self) {
        let mut arrived = [0.0f32; TEMPI];
        for (ring, arrived) in self.rings.iter_mut().zip(&mut arrived) {
            let period = ring.states.len();
            ring.zero = (ring.zero + period - 1) % period;
            *arrived = ring.states[ring.zero];
        }
        for (to, ring) in self.rings.iter_mut().enumerate() {
            let first = to.saturating_sub(REACH);
            let last = (to + REACH).min(TEMPI - 1);
            ring.states[ring.zero] = (first..=last)
                .map(|from| self.steps[from][to + REACH - from] * arrived[from])
                .sum();
        }
    }

    /// States near a beat gain or lose by what was heard.
    fn weigh(&mut self, strength: f32) {
        let log = GAIN * (strength - NEUTRAL);
        let factors = self.bell.map(|bell| (log * bell).exp());
        for ring in &mut self.rings {
            let period = ring.states.len();
            ring.states[ring.zero] *= factors[0];
            for (hop, factor) in factors.iter().enumerate().skip(1) {
                let late = ring.at(hop);
                ring.states[late] *= factor;
                let early = ring.at(period - hop);
                ring.states[early] *= factor;
            }
        }
    }

    /// Brings the sum back to one and mixes in what the tempogram suggests for
    /// the `elapsed_s` since the last time; due every few hops.
    pub(crate) fn settle(&mut self, suggestion: &[f32; TEMPI], elapsed_s: f32) {
        let total: f32 = self.rings.iter().map(Ring::total).sum();
        let lend = LEND_PER_S * elapsed_s;
        let scale = (1.0 - lend) / total.max(1e-30);
        for (i, (ring, wish)) in self.rings.iter_mut().zip(suggestion).enumerate() {
            let usual = USUAL_PER_S * prior_of(bpm(i)).ln();
            let fitting = FITTING_PER_S * (wish * TEMPI as f32).ln();
            let pull = (1.0 + elapsed_s * (usual + fitting)).max(0.5);
            let lent = lend * wish / ring.states.len() as f32;
            for state in &mut ring.states {
                *state = *state * scale * pull + lent;
            }
        }
    }

    /// The most believed tempo with its neighbours, and the phase in it.
    pub(crate) fn estimate(&self) -> Estimate {
        let totals: [f32; TEMPI] = std::array::from_fn(|i| self.rings[i].total());
        let around = |i: usize| -> f32 {
            let reach = period(i) / 40;
            totals[i.saturating_sub(reach)..(i + reach + 1).min(TEMPI)]
                .iter()
                .sum()
        };
        let best = (0..TEMPI)
            .max_by(|&a, &b| around(a).total_cmp(&around(b)))
            .unwrap_or(0);
        let phase = self.peak_phase(best);
        let reach = period(best) / 20;
        let low = best.saturating_sub(reach);
        let high = (best + reach + 1).min(TEMPI);
        // Mean tempo of the neighbourhood; mass near the phase.
        let (mut mass, mut turn, mut weight) = (0.0f32, 0.0f64, 0.0f64);
        let (mut sin, mut cos) = (0.0f64, 0.0f64);
        for (i, ring) in self.rings.iter().enumerate().take(high).skip(low) {
            let period = ring.states.len();
            weight += f64::from(totals[i]);
            turn += f64::from(totals[i]) * bpm(i).ln();
            let reach = period as i64 / 8;
            let centre = (phase * period as f64).round() as i64;
            for offset in -reach..=reach {
                let since = (centre + offset).rem_euclid(period as i64) as usize;
                let value = ring.states[ring.at(since)];
                mass += value;
                let angle = offset as f64 / period as f64;
                sin += f64::from(value) * angle;
                cos += f64::from(value);
            }
        }
        let shift = if cos > 0.0 { sin / cos } else { 0.0 };
        Estimate {
            bpm: (turn / weight.max(1e-30)).exp(),
            phase: (phase + shift).rem_euclid(1.0),
            mass,
        }
    }

    fn peak_phase(&self, tempo: usize) -> f64 {
        let ring = &self.rings[tempo];
        let period = ring.states.len();
        let best = (0..period)
            .max_by(|&a, &b| ring.states[ring.at(a)].total_cmp(&ring.states[ring.at(b)]))
            .unwrap_or(0);
        best as f64 / period as f64
    }
}
