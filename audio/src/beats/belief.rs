//! A belief over tempo and phase, updated at every hop (a bar-pointer model
//! with one-beat bars; Whiteley 2006, efficient state space after Krebs 2015).
//!
//! Each tempo has one state for every hop of its period: hops since the last
//! beat. Time moves all of them on by one, which costs nothing in a ring; only
//! the states near a beat are reweighted by what was heard. At a beat the tempo
//! may change a little; now and then belief is lent to the tempi that the
//! tempogram suggests, so that a new song is found soon. Constant memory.

use super::tempo::{TEMPI, bpm};

/// Half width of the window around a beat in which onsets count, seconds.
const BEAT_SIGMA_S: f64 = 0.014;
const BEAT_REACH_S: f64 = 0.035;
/// Weight of an onset's strength in the log-likelihood of a beat.
const GAIN: f32 = 1.6;
/// Strength that is neither for nor against a beat.
const NEUTRAL: f32 = 0.22;
/// Chance of a step to a neighbouring tempo at a beat.
const TEMPO_STEP: f32 = 0.02;
/// Belief lent to the tempogram's suggestion in one second.
const LEND_PER_S: f64 = 0.04;

/// One tempo's states: a ring of hops since the last beat.
struct Ring {
    states: Vec<f32>,
    /// Where the state "on the beat now" is.
    zero: usize,
}

impl Ring {
    fn at(&self, since_beat: usize) -> usize {
        (self.zero + since_beat) % self.states.len()
    }

    fn total(&self) -> f32 {
        self.states.iter().sum()
    }
}

/// What is believed of tempo and phase.
pub(crate) struct Belief {
    rings: Vec<Ring>,
    rate_hz: f64,
    /// The bell around a beat, by distance in hops.
    bell: Vec<f32>,
    lend: f32,
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
    pub(crate) fn new(rate_hz: f64) -> Self {
        let prior: Vec<f32> = (0..TEMPI).map(|i| super::tempo::prior_of(bpm(i))).collect();
        let sum: f32 = prior.iter().sum();
        let rings = (0..TEMPI)
            .map(|i| {
                let period = (60.0 / bpm(i) * rate_hz).round() as usize;
                Ring {
                    states: vec![prior[i] / sum / period as f32; period],
                    zero: 0,
                }
            })
            .collect();
        let reach = (BEAT_REACH_S * rate_hz) as usize;
        let bell = (0..=reach)
            .map(|hop| {
                let x = hop as f64 / rate_hz / BEAT_SIGMA_S;
                (-0.5 * x * x).exp() as f32
            })
            .collect();
        Self {
            rings,
            rate_hz,
            bell,
            lend: (LEND_PER_S / rate_hz) as f32,
        }
    }

    /// Moves on by one hop in which `strength` was heard.
    pub(crate) fn hop(&mut self, strength: f32, suggestion: &[f32; TEMPI]) {
        self.advance();
        self.weigh(strength);
        self.normalise(suggestion);
    }

    fn advance(&mut self) {
        let mut arrived = [0.0f32; TEMPI];
        for (ring, arrived) in self.rings.iter_mut().zip(&mut arrived) {
            let period = ring.states.len();
            ring.zero = (ring.zero + period - 1) % period;
            *arrived = ring.states[ring.zero];
        }
        for (i, ring) in self.rings.iter_mut().enumerate() {
            let below = arrived[i.saturating_sub(1)];
            let above = arrived[(i + 1).min(TEMPI - 1)];
            ring.states[ring.zero] =
                (1.0 - 2.0 * TEMPO_STEP) * arrived[i] + TEMPO_STEP * (below + above);
        }
    }

    /// States near a beat gain or lose by what was heard.
    fn weigh(&mut self, strength: f32) {
        let log = GAIN * (strength - NEUTRAL);
        for ring in &mut self.rings {
            let period = ring.states.len();
            for (hop, bell) in self.bell.iter().enumerate() {
                let factor = (log * bell).exp();
                let late = ring.at(hop);
                ring.states[late] *= factor;
                if hop > 0 {
                    let early = ring.at(period - hop);
                    ring.states[early] *= factor;
                }
            }
        }
    }

    fn normalise(&mut self, suggestion: &[f32; TEMPI]) {
        let total: f32 = self.rings.iter().map(Ring::total).sum();
        let scale = (1.0 - self.lend) / total.max(1e-30);
        for (ring, wish) in self.rings.iter_mut().zip(suggestion) {
            let lent = self.lend * wish / ring.states.len() as f32;
            for state in &mut ring.states {
                *state = *state * scale + lent;
            }
        }
    }

    /// The most believed tempo with its neighbours, and the phase in it.
    pub(crate) fn estimate(&self) -> Estimate {
        let totals: Vec<f32> = self.rings.iter().map(Ring::total).collect();
        let around = |i: usize| -> f32 {
            let low = i.saturating_sub(1);
            totals[low..(i + 2).min(TEMPI)].iter().sum()
        };
        let best = (0..TEMPI)
            .max_by(|&a, &b| around(a).total_cmp(&around(b)))
            .unwrap_or(0);
        let phase = self.peak_phase(best);
        let low = best.saturating_sub(2);
        let high = (best + 3).min(TEMPI);
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

    /// Hops a second.
    pub(crate) fn rate_hz(&self) -> f64 {
        self.rate_hz
    }
}
