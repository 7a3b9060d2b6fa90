//! The beat that the onsets alone give: one voice that the
//! [bar pointer](super::bar_pointer) listens to, beside the network's.
//!
//! ```text
//! onset strength -> tempogram -> tempo filter -> oscillator -> metrical level -> OnsetBeat
//! kicks, middle voices, beats of the small network ---------------^
//! ```
//!
//! While locked an oscillator follows the filter's estimate by small corrections; an
//! estimate that contradicts it for a while is taken over at once. It knows no bars and
//! keeps its metrical level for long, which serves music in which drums are steady and
//! the network is unsure: metal. It is never danced to by itself.

use super::beat_evidence::OnsetBeat;
use super::metrical_level::{MetricalLevel, MetricalReading};
use super::state_space::{RATE_HZ, evidence};
use super::tempo::{TempoEstimate, TempoFilter};
use super::tempogram::{Tempogram, TempogramFit};
use crate::features::onset_strength::Onset;
use servodance_types::BeatLock;

/// Confidence that locks, and confidence below which a lock only holds.
const LOCK: f32 = 0.4;
const UNLOCK: f32 = 0.25;
/// Presence of music that a lock needs, and how long it may be absent.
const MUSIC: f32 = 0.5;
const ABSENT_S: f64 = 4.0;
/// Clarity of the tempogram for noise and speech, and for music.
const IRREGULAR: f32 = 0.1;
const REGULAR: f32 = 0.2;
/// Longest hold without confidence.
const HOLD_S: f64 = 7.0;
/// Silence that ends the music.
const SILENCE_S: f64 = 1.5;
/// How long a contradicting estimate must last before it is taken over.
const PATIENCE_S: f64 = 0.3;
/// The same for half, double or the off-beat of what is followed.
const LEVEL_PATIENCE_S: f64 = 1.0;
/// Share of the phase error that is corrected in one second.
const PHASE_PULL_PER_S: f64 = 2.7;
/// Change of tempo, in beats a second per second, for a phase error of one.
const LAG_PULL_PER_S2: f64 = 1.3;
/// Share of the tempo error that is corrected in one second.
const TEMPO_PULL_PER_S: f64 = 0.8;

pub(crate) struct OnsetTracker {
    tempogram: Tempogram,
    filter: TempoFilter,
    fit: TempogramFit,
    hops: u64,
    state: BeatLock,
    phase: f64,
    bpm: f64,
    confidence: f32,
    presence: f32,
    absent_s: f64,
    unsure_s: f64,
    silent_s: f64,
    contradicted_s: f64,
    level: MetricalLevel,
}

/// Hops between two comparisons of the oscillator with the filter.
const UPDATE_EVERY: u64 = 8;

impl OnsetTracker {
    pub(crate) fn new() -> Self {
        let tempogram = Tempogram::new();
        Self {
            fit: tempogram.fit(),
            tempogram,
            filter: TempoFilter::new(),
            hops: 0,
            state: BeatLock::Lost,
            phase: 0.0,
            bpm: 0.0,
            confidence: 0.0,
            presence: 0.0,
            absent_s: 0.0,
            unsure_s: 0.0,
            silent_s: f64::INFINITY,
            contradicted_s: 0.0,
            level: MetricalLevel::default(),
        }
    }

    fn is_silent(&self) -> bool {
        self.silent_s > SILENCE_S
    }

    pub(crate) fn set_presence(&mut self, presence: f32) {
        self.presence = presence;
    }

    /// Takes one hop and the probability of a beat by the small network.
    pub(crate) fn hop(&mut self, onset: &Onset, beat: f32) {
        let hop_s = 1.0 / RATE_HZ;
        self.silent_s = if onset.audible { 0.0 } else { self.silent_s + hop_s };
        self.tempogram.push(onset.strength);
        self.filter.hop(evidence(onset.strength));
        let phase = self.phase + self.bpm / 60.0 * hop_s;
        self.phase = phase.rem_euclid(1.0);
        self.level.count(phase.floor() as i64);
        self.level.push(self.phase, self.bpm, [onset.groups[0], onset.groups[1], beat]);
        self.hops += 1;
        if self.hops.is_multiple_of(UPDATE_EVERY) {
            let elapsed_s = UPDATE_EVERY as f64 * hop_s;
            self.fit = self.tempogram.fit();
            self.filter.mix_in(&self.fit.likelihood, elapsed_s as f32);
            self.update(elapsed_s);
        }
    }

    fn update(&mut self, elapsed_s: f64) {
        let estimate = self.filter.estimate();
        let clarity = if self.is_silent() {
            0.0
        } else {
            let regular = (self.fit.clarity - IRREGULAR) / (REGULAR - IRREGULAR);
            let music = (self.presence / MUSIC).min(1.0);
            music * ((estimate.mass - 0.15) / 0.6).clamp(0.0, 1.0) * regular.clamp(0.0, 1.0)
        };
        let pull = (2.0 * elapsed_s) as f32;
        self.confidence += pull.min(1.0) * (clarity - self.confidence);
        if self.is_silent() {
            self.confidence = 0.0;
        }
        self.absent_s = if self.presence > MUSIC { 0.0 } else { self.absent_s + elapsed_s };
        self.change_state(estimate, elapsed_s);
        match self.state {
            BeatLock::Lost => {
                self.phase = estimate.phase;
                self.bpm = estimate.bpm;
            }
            _ => {
                self.follow(estimate, elapsed_s);
                self.level.choose(self.bpm, elapsed_s);
            }
        }
    }

    fn change_state(&mut self, estimate: TempoEstimate, elapsed_s: f64) {
        if self.is_silent() || self.absent_s > ABSENT_S {
            self.state = BeatLock::Lost;
            return;
        }
        match self.state {
            BeatLock::Lost if self.confidence > LOCK && self.presence > MUSIC => {
                self.state = BeatLock::Locked;
                self.unsure_s = 0.0;
                self.contradicted_s = 0.0;
                self.phase = estimate.phase;
                self.bpm = estimate.bpm;
                self.level.restart();
            }
            BeatLock::Locked if self.confidence < UNLOCK => {
                self.state = BeatLock::Holding;
                self.unsure_s = 0.0;
            }
            BeatLock::Holding if self.confidence > LOCK => self.state = BeatLock::Locked,
            BeatLock::Holding => {
                self.unsure_s += elapsed_s;
                if self.unsure_s > HOLD_S {
                    self.state = BeatLock::Lost;
                }
            }
            _ => {}
        }
    }

    fn follow(&mut self, estimate: TempoEstimate, elapsed_s: f64) {
        let error = wrap(estimate.phase - self.phase);
        let tempo_error = (estimate.bpm / self.bpm).ln();
        if tempo_error.abs() < 0.06 && error.abs() < 0.15 {
            self.contradicted_s = 0.0;
            let trust = f64::from(self.confidence);
            let phase = self.phase + (PHASE_PULL_PER_S * elapsed_s * trust).min(1.0) * error;
            // Pulled back over a beat that has passed, it will pass once more.
            self.level.count(phase.floor() as i64);
            self.phase = phase.rem_euclid(1.0);
            // The integral part, without which a wrong tempo would leave a lag.
            self.bpm += 60.0 * LAG_PULL_PER_S2 * elapsed_s * trust * error;
            self.bpm *= (TEMPO_PULL_PER_S * elapsed_s * trust * tempo_error).exp();
            return;
        }
        if self.confidence > UNLOCK {
            self.contradicted_s += elapsed_s;
        }
        // Another metrical level of the same beat is doubtful: wait longer.
        let octave = (estimate.bpm / self.bpm).log2();
        let related = (octave - octave.round()).abs() < 0.06;
        let patience_s = if related { LEVEL_PATIENCE_S } else { PATIENCE_S };
        if self.contradicted_s > patience_s {
            let output = self.level.apply(self.phase, self.bpm);
            self.phase = estimate.phase;
            self.bpm = estimate.bpm;
            self.level.carry_over(output, self.phase, self.bpm);
            self.contradicted_s = 0.0;
        }
    }

    /// Every metrical reading of the beat `ahead_s` seconds after the newest hop;
    /// none without a beat.
    pub(crate) fn readings(&self, ahead_s: f64) -> Vec<MetricalReading> {
        if self.state == BeatLock::Lost {
            return Vec::new();
        }
        let phase = self.phase + self.bpm / 60.0 * ahead_s;
        self.level.readings(phase, self.bpm)
    }

    /// What the beat is `late_s` before the newest hop.
    pub(crate) fn beat(&self, late_s: f64) -> OnsetBeat {
        if self.bpm <= 0.0 || self.state == BeatLock::Lost {
            return OnsetBeat::default();
        }
        let (phase, bpm) = self.level.apply(self.phase, self.bpm);
        let off = wrap(phase - late_s * bpm / 60.0);
        OnsetBeat { off_s: (off * 60.0 / bpm) as f32, confidence: self.confidence }
    }
}

/// A phase difference brought to -0.5..0.5.
fn wrap(phase: f64) -> f64 {
    phase - phase.round()
}
