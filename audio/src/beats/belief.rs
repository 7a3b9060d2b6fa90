//! A belief over tempo and phase, updated at every hop (a bar-pointer model
//! with one-beat bars; Whiteley 2006, efficient state space after Krebs 2015).
//! Each state carries the likelihood of the best path to it, not the sum over
//! all: the best path changes its mind less.
//!
//! Each tempo has one state for every hop of its period: hops since the last
//! beat. Time moves all of them on by one, which costs nothing in a ring; only
//! the states near a beat are reweighted by what was heard. At a beat the tempo
//! may change a little or, rarely, to anything; the tempi that the tempogram
//! suggests gain a little. Constant memory.

use super::tempo::{RATE_HZ, TEMPI, bpm, period, prior_of};

/// Width of the bell around a beat in which onsets count, seconds, and its half
/// length in hops.
const BEAT_SIGMA_S: f32 = 0.017;
pub(crate) const BELL: usize = 6;
/// Weight of an onset's strength in the log-likelihood of a beat.
const GAIN: f32 = 2.1;
/// Strength that is neither for nor against a beat.
const NEUTRAL: f32 = 0.07;
/// How fast the chance of a change of tempo falls with its relative size.
const STEADINESS: f32 = 120.0;
/// Furthest change of the period at one beat, hops.
pub(crate) const REACH: usize = 3;
/// Likelihood of a leap to any other tempo at a beat: another song.
const LEAP: f32 = -20.0;
/// Weight of the usual tempi, log-likelihood a second, paid at each beat.
const USUAL_PER_S: f64 = 0.1;
/// Weight of the tempogram, log-likelihood a second.
const FITTING_PER_S: f32 = 0.3;

/// What an onset strength says for a beat in its hop, log-likelihood.
pub(crate) fn evidence(strength: f32) -> f32 {
    GAIN * (strength - NEUTRAL)
}

/// What a beat at this tempo costs for being unusual, log-likelihood.
pub(crate) fn unusual(tempo: usize) -> f32 {
    let bpm = bpm(tempo);
    (USUAL_PER_S * 60.0 / bpm) as f32 * prior_of(bpm).ln()
}

/// One tempo's states: a ring of hops since the last beat.
pub(crate) struct Ring {
    states: Vec<f32>,
    /// Where the state "on the beat now" is.
    zero: usize,
}

impl Ring {
    pub(crate) fn filled(period: usize, value: f32) -> Self {
        Self {
            states: vec![value; period],
            zero: 0,
        }
    }

    fn place(&self, since_beat: usize) -> usize {
        let at = self.zero + since_beat;
        if at < self.states.len() {
            at
        } else {
            at - self.states.len()
        }
    }

    pub(crate) fn at(&self, since_beat: usize) -> f32 {
        self.states[self.place(since_beat)]
    }

    pub(crate) fn at_mut(&mut self, since_beat: usize) -> &mut f32 {
        let place = self.place(since_beat);
        &mut self.states[place]
    }

    /// Moves every state on by one hop; returns the one that arrives at the
    /// next beat, whose place is then that beat's.
    pub(crate) fn advance(&mut self) -> f32 {
        let period = self.states.len();
        self.zero = (self.zero + period - 1) % period;
        self.states[self.zero]
    }

    /// Changes the states near a beat by their distance from it, hops.
    pub(crate) fn near_beat(&mut self, change: impl Fn(&mut f32, usize)) {
        let period = self.states.len();
        change(self.at_mut(0), 0);
        for distance in 1..BELL {
            change(self.at_mut(distance), distance);
            change(self.at_mut(period - distance), distance);
        }
    }

    fn total(&self) -> f32 {
        self.states.iter().sum()
    }
}

/// The bell around a beat, by distance in hops.
pub(crate) fn bell() -> [f32; BELL] {
    std::array::from_fn(|hop| {
        let x = hop as f32 / RATE_HZ as f32 / BEAT_SIGMA_S;
        (-0.5 * x * x).exp()
    })
}

/// Chances of the steps from each tempo to its neighbours.
pub(crate) fn steps() -> Vec<[f32; 2 * REACH + 1]> {
    (0..TEMPI)
        .map(|from| {
            let mut chances: [f32; 2 * REACH + 1] = std::array::from_fn(|k| {
                let change = (k as f32 - REACH as f32).abs() / period(from) as f32;
                (-STEADINESS * change).exp()
            });
            let sum: f32 = chances.iter().sum();
            chances.iter_mut().for_each(|c| *c /= sum);
            chances
        })
        .collect()
}

/// What is believed of tempo and phase.
pub(crate) struct Belief {
    rings: Vec<Ring>,
    /// The bell around a beat, by distance in hops.
    bell: [f32; BELL],
    /// Chances of the steps from each tempo to its neighbours.
    steps: Vec<[f32; 2 * REACH + 1]>,
    /// What a beat at each tempo costs, as a factor.
    unusual: [f32; TEMPI],
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
                Ring::filled(period, prior[i] / sum / period as f32)
            })
            .collect();
        Self {
            steps: steps(),
            rings,
            bell: bell(),
            unusual: std::array::from_fn(|i| unusual(i).exp()),
        }
    }

    /// Moves on by one hop with this evidence for a beat, log-odds.
    pub(crate) fn hop(&mut self, evidence: f32) {
        self.advance();
        self.weigh(evidence);
    }

    fn advance(&mut self) {
        let arrived: [f32; TEMPI] = std::array::from_fn(|i| self.rings[i].advance());
        let leap = LEAP.exp() * arrived.iter().fold(0.0f32, |m, &v| m.max(v));
        for (to, ring) in self.rings.iter_mut().enumerate() {
            let first = to.saturating_sub(REACH);
            let last = (to + REACH).min(TEMPI - 1);
            let near =
                (first..=last).map(|from| self.steps[from][to + REACH - from] * arrived[from]);
            *ring.at_mut(0) = self.unusual[to] * near.fold(leap, f32::max);
        }
    }

    /// States near a beat gain or lose by what was heard.
    fn weigh(&mut self, evidence: f32) {
        let factors = self.bell.map(|bell| (evidence * bell).exp());
        for ring in &mut self.rings {
            ring.near_beat(|state, distance| *state *= factors[distance]);
        }
    }

    /// Brings the sum back to one and mixes in what the tempogram suggests for
    /// the `elapsed_s` since the last time; due every few hops.
    pub(crate) fn settle(&mut self, suggestion: &[f32; TEMPI], elapsed_s: f32) {
        let total: f32 = self.rings.iter().map(Ring::total).sum();
        let scale = 1.0 / total.max(1e-30);
        for (ring, wish) in self.rings.iter_mut().zip(suggestion) {
            let fitting = FITTING_PER_S * (wish * TEMPI as f32).ln();
            let pull = (1.0 + elapsed_s * fitting).max(0.5);
            ring.states
                .iter_mut()
                .for_each(|state| *state *= scale * pull);
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
                let value = ring.at(since);
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
            .max_by(|&a, &b| ring.at(a).total_cmp(&ring.at(b)))
            .unwrap_or(0);
        best as f64 / period as f64
    }
}
