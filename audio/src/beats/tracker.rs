//! The causal beat tracker: belief in, a steady oscillator out.
//!
//! ```text
//!            confident                unsure
//!   Lost ----------------> Locked <=========> Holding
//!    ^                     (follows)          (coasts on)
//!    |                                            |
//!    +------ unsure for HOLD_S, or silence -------+
//! ```
//!
//! While locked the oscillator follows the belief by small corrections, so that
//! its phase never jumps for one late drum; a different tempo or phase that
//! stays believed for a while is taken over at once.

use super::belief::{Belief, Estimate};
use super::level::Level;
use super::tempo::{RATE_HZ, TempoFit, Tempogram};
use crate::onset::Onset;
use servodance_types::{Beat, BeatLock};

/// Confidence to lock, and below which a lock is held only.
const LOCK: f32 = 0.4;
const UNLOCK: f32 = 0.25;
/// Clarity of the tempogram for noise and speech, and for music.
const IRREGULAR: f32 = 0.1;
const REGULAR: f32 = 0.2;
/// How long a lock is held without confidence.
const HOLD_S: f64 = 7.0;
/// Silence for so long ends the music.
const SILENCE_S: f64 = 1.5;
/// A contradicting belief must last so long before it is followed.
const PATIENCE_S: f64 = 1.0;
/// The same for half, double or the off-beat of what is followed.
const LEVEL_PATIENCE_S: f64 = 4.0;
/// Time constant of the presence of music.
const PRESENCE_S: f64 = 1.0;
/// Share of the phase error that is corrected in one second.
const PHASE_PULL_PER_S: f64 = 2.7;
/// Change of tempo, in beats a second per second, for a phase error of one.
const LAG_PULL_PER_S2: f64 = 1.3;
/// Share of the tempo error that is corrected in one second.
const TEMPO_PULL_PER_S: f64 = 0.8;

/// Follows the beat hop by hop.
pub(crate) struct Tracker {
    tempogram: Tempogram,
    belief: Belief,
    fit: TempoFit,
    hops: u64,
    state: BeatLock,
    phase: f64,
    bpm: f64,
    confidence: f32,
    presence: f32,
    unsure_s: f64,
    silent_s: f64,
    contradicted_s: f64,
    level: Level,
}

/// Hops between two looks at the tempogram and the belief.
const LOOK_EVERY: u64 = 8;

impl Tracker {
    pub(crate) fn new() -> Self {
        let tempogram = Tempogram::new();
        Self {
            fit: tempogram.fit(),
            tempogram,
            belief: Belief::new(),
            hops: 0,
            state: BeatLock::Lost,
            phase: 0.0,
            bpm: 0.0,
            confidence: 0.0,
            presence: 0.0,
            unsure_s: 0.0,
            silent_s: f64::INFINITY,
            contradicted_s: 0.0,
            level: Level::default(),
        }
    }

    /// Whether this is music: audible and regular, over the last seconds.
    pub(crate) fn presence(&self) -> f32 {
        self.presence
    }

    pub(crate) fn state(&self) -> BeatLock {
        self.state
    }

    /// Takes one hop of onset strength.
    pub(crate) fn hop(&mut self, onset: Onset) {
        let hop_s = 1.0 / RATE_HZ;
        self.silent_s = if onset.audible {
            0.0
        } else {
            self.silent_s + hop_s
        };
        self.tempogram.push(onset.strength);
        self.belief.hop(onset.strength);
        let phase = self.phase + self.bpm / 60.0 * hop_s;
        self.phase = phase.rem_euclid(1.0);
        self.level.hear(self.phase, phase >= 1.0, onset.strength);
        self.hops += 1;
        if self.hops.is_multiple_of(LOOK_EVERY) {
            let elapsed_s = LOOK_EVERY as f64 * hop_s;
            self.fit = self.tempogram.fit();
            self.belief.settle(&self.fit.likelihood, elapsed_s as f32);
            self.look(elapsed_s);
        }
    }

    /// Compares the oscillator with the belief.
    fn look(&mut self, elapsed_s: f64) {
        let estimate = self.belief.estimate();
        let clarity = if self.silent_s > SILENCE_S {
            0.0
        } else {
            let regular = (self.fit.clarity - IRREGULAR) / (REGULAR - IRREGULAR);
            ((estimate.mass - 0.15) / 0.6).clamp(0.0, 1.0) * regular.clamp(0.0, 1.0)
        };
        let regular = if self.silent_s > SILENCE_S {
            0.0
        } else {
            ((self.fit.clarity - IRREGULAR) / (REGULAR - IRREGULAR)).clamp(0.0, 1.0)
        };
        self.presence += (elapsed_s / PRESENCE_S) as f32 * (regular - self.presence);
        let pull = (2.0 * elapsed_s) as f32;
        self.confidence += pull.min(1.0) * (clarity - self.confidence);
        if self.silent_s > SILENCE_S {
            self.confidence = 0.0;
        }
        self.change_state(estimate, elapsed_s);
        match self.state {
            BeatLock::Lost => {
                self.phase = estimate.phase;
                self.bpm = estimate.bpm;
            }
            BeatLock::Locked | BeatLock::Holding => {
                self.follow(estimate, elapsed_s);
                self.level.choose(self.bpm, elapsed_s);
            }
        }
    }

    fn change_state(&mut self, estimate: Estimate, elapsed_s: f64) {
        if self.silent_s > SILENCE_S {
            self.state = BeatLock::Lost;
            return;
        }
        match self.state {
            BeatLock::Lost if self.confidence > LOCK => {
                self.state = BeatLock::Locked;
                self.unsure_s = 0.0;
                self.contradicted_s = 0.0;
                self.phase = estimate.phase;
                self.bpm = estimate.bpm;
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
            BeatLock::Lost | BeatLock::Locked => {}
        }
    }

    fn follow(&mut self, estimate: Estimate, elapsed_s: f64) {
        let error = wrap(estimate.phase - self.phase);
        let tempo_error = (estimate.bpm / self.bpm).ln();
        if tempo_error.abs() < 0.06 && error.abs() < 0.15 {
            self.contradicted_s = 0.0;
            let trust = f64::from(self.confidence);
            self.phase += (PHASE_PULL_PER_S * elapsed_s * trust).min(1.0) * error;
            self.phase = self.phase.rem_euclid(1.0);
            // The integral part, without which a wrong tempo would leave a lag.
            self.bpm += 60.0 * LAG_PULL_PER_S2 * elapsed_s * trust * error;
            self.bpm *= (TEMPO_PULL_PER_S * elapsed_s * trust * tempo_error).exp();
            return;
        }
        if self.confidence > UNLOCK {
            self.contradicted_s += elapsed_s;
        }
        // Another level of the same beat is doubtful news: wait longer.
        let octave = (estimate.bpm / self.bpm).log2();
        let related = (octave - octave.round()).abs() < 0.06;
        let patience_s = if related {
            LEVEL_PATIENCE_S
        } else {
            PATIENCE_S
        };
        if self.contradicted_s > patience_s {
            let danced = self.level.apply(self.phase, self.bpm);
            self.phase = estimate.phase;
            self.bpm = estimate.bpm;
            self.level.carry_over(danced, self.phase, self.bpm);
            self.contradicted_s = 0.0;
        }
    }

    /// The beat `ahead_s` seconds after the newest hop.
    pub(crate) fn beat(&self, ahead_s: f64) -> Beat {
        if self.bpm <= 0.0 || self.confidence <= 0.0 {
            return Beat::default();
        }
        let (phase, bpm) = self.level.apply(self.phase, self.bpm);
        let phase = (phase + bpm / 60.0 * ahead_s).rem_euclid(1.0) as f32;
        Beat {
            phase: if phase < 1.0 { phase } else { 0.0 },
            tempo_bpm: bpm as f32,
            confidence: self.confidence,
            lock: self.state,
            beat_in_bar: None,
        }
    }
}

/// A phase difference brought to -0.5..0.5.
fn wrap(phase: f64) -> f64 {
    phase - phase.round()
}
