//! Decides tempo and phase of the beat: a filter over the states of
//! [`state_space`](super::state_space), updated at every hop.
//!
//! Each state carries the likelihood of the best path to it, not the sum over
//! all paths: the best path changes less often. At every hop the states near a
//! beat are reweighted by the onset strength. At a beat the tempo may change a
//! little or, rarely, to any other; the tempi that the
//! [tempogram](super::tempogram) suggests gain a little. Constant memory.
//!
//! The [tracker](super::tracker) follows the [`TempoEstimate`] smoothly; the
//! [metrical level](super::metrical_level) decides between a period, its half
//! and its double.

use super::state_space::{
    BELL, REACH, TEMPI, TempoStates, beat_cost, bell, bpm, period, prior, steps,
};

/// Log-likelihood of a leap to any other tempo at a beat: another song.
const LEAP: f32 = -20.0;
/// Weight of the tempogram, log-likelihood a second.
const TEMPOGRAM_PER_S: f32 = 0.3;

pub(super) struct TempoFilter {
    tempi: Vec<TempoStates>,
    bell: [f32; BELL],
    steps: Vec<[f32; 2 * REACH + 1]>,
    /// [`beat_cost`] of each tempo as a factor.
    costs: [f32; TEMPI],
}

#[derive(Clone, Copy, Debug)]
pub(super) struct TempoEstimate {
    pub(super) bpm: f64,
    /// Beats since the last beat, 0 to 1.
    pub(super) phase: f64,
    /// Probability of this tempo and phase and their near neighbours, 0 to 1.
    pub(super) mass: f32,
}

impl TempoFilter {
    pub(super) fn new() -> Self {
        let sum: f32 = (0..TEMPI).map(prior).sum();
        let states = |i| TempoStates::filled(i, prior(i) / sum / period(i) as f32);
        Self {
            tempi: (0..TEMPI).map(states).collect(),
            bell: bell(),
            steps: steps(),
            costs: std::array::from_fn(|i| beat_cost(i).exp()),
        }
    }

    /// Advances one hop with this evidence for a beat, log-odds.
    pub(super) fn hop(&mut self, evidence: f32) {
        self.advance();
        self.weigh(evidence);
    }

    fn advance(&mut self) {
        let arrived: [f32; TEMPI] = std::array::from_fn(|i| self.tempi[i].advance());
        let leap = LEAP.exp() * arrived.iter().fold(0.0f32, |m, &v| m.max(v));
        for (to, states) in self.tempi.iter_mut().enumerate() {
            let first = to.saturating_sub(REACH);
            let last = (to + REACH).min(TEMPI - 1);
            let near =
                (first..=last).map(|from| self.steps[from][to + REACH - from] * arrived[from]);
            *states.at_mut(0) = self.costs[to] * near.fold(leap, f32::max);
        }
    }

    fn weigh(&mut self, evidence: f32) {
        let factors = self.bell.map(|bell| (evidence * bell).exp());
        for states in &mut self.tempi {
            states.near_beat(|state, distance| *state *= factors[distance]);
        }
    }

    /// Normalizes the sum to one and mixes in the likelihoods of the tempogram
    /// for the `elapsed_s` since the last call; due every few hops.
    pub(super) fn mix_in(&mut self, tempogram: &[f32; TEMPI], elapsed_s: f32) {
        let total: f32 = self.tempi.iter().map(TempoStates::total).sum();
        let scale = 1.0 / total.max(1e-30);
        for (states, likelihood) in self.tempi.iter_mut().zip(tempogram) {
            let gain = TEMPOGRAM_PER_S * (likelihood * TEMPI as f32).ln();
            states.scale(scale * (1.0 + elapsed_s * gain).max(0.5));
        }
    }

    pub(super) fn estimate(&self) -> TempoEstimate {
        let totals: [f32; TEMPI] = std::array::from_fn(|i| self.tempi[i].total());
        let around = |i: usize| -> f32 {
            let reach = period(i) / 40;
            totals[i.saturating_sub(reach)..(i + reach + 1).min(TEMPI)].iter().sum()
        };
        let best = (0..TEMPI).max_by(|&a, &b| around(a).total_cmp(&around(b))).unwrap_or(0);
        let phase = self.tempi[best].likeliest() as f64 / period(best) as f64;
        let reach = period(best) / 20;
        let low = best.saturating_sub(reach);
        let high = (best + reach + 1).min(TEMPI);
        // Mean tempo of the neighbourhood; mass near the phase.
        let (mut mass, mut turn, mut weight) = (0.0f32, 0.0f64, 0.0f64);
        let (mut sin, mut cos) = (0.0f64, 0.0f64);
        for (i, states) in self.tempi.iter().enumerate().take(high).skip(low) {
            let period = period(i);
            weight += f64::from(totals[i]);
            turn += f64::from(totals[i]) * bpm(i).ln();
            let reach = period as i64 / 8;
            let centre = (phase * period as f64).round() as i64;
            for offset in -reach..=reach {
                let since = (centre + offset).rem_euclid(period as i64) as usize;
                let value = states.at(since);
                mass += value;
                let angle = offset as f64 / period as f64;
                sin += f64::from(value) * angle;
                cos += f64::from(value);
            }
        }
        let shift = if cos > 0.0 { sin / cos } else { 0.0 };
        TempoEstimate {
            bpm: (turn / weight.max(1e-30)).exp(),
            phase: (phase + shift).rem_euclid(1.0),
            mass,
        }
    }
}
