//! The causal beat tracker: belief in, a steady oscillator out.
//!
//! ```text
//!            confident                unsure
//!   Lost ----------------> Locked <=========> Holding
//!    ^                     (follows)          (coasts on)
//!    |                         |                  |
//!    +-- silence, no music ----+- unsure HOLD_S --+
//! ```
//!
//! While locked the oscillator follows the belief by small corrections, so that
//! its phase never jumps for one late drum; a different tempo or phase that
//! stays believed for a while is taken over at once.

use super::bar::Bar;
use super::belief::{Belief, Estimate, evidence};
use super::level::{Level, LevelReading};
use super::network::{Heard, sigmoid};
use super::tempo::{RATE_HZ, TempoFit, Tempogram};
use crate::onset::Onset;
use servodance_types::{Beat, BeatLock};

/// Confidence to lock, and below which a lock is held only.
const LOCK: f32 = 0.4;
const UNLOCK: f32 = 0.25;
/// Presence of music needed to lock; absent for so long, the lock is lost.
const MUSIC: f32 = 0.5;
const ABSENT_S: f64 = 4.0;
/// Clarity of the tempogram for noise and speech, and for music.
const IRREGULAR: f32 = 0.1;
const REGULAR: f32 = 0.2;
/// How long a lock is held without confidence.
const HOLD_S: f64 = 7.0;
/// Silence for so long ends the music.
const SILENCE_S: f64 = 1.5;
/// A contradicting belief must last so long before it is followed.
const PATIENCE_S: f64 = 0.3;
/// The same for half, double or the off-beat of what is followed.
const LEVEL_PATIENCE_S: f64 = 1.0;
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
    absent_s: f64,
    unsure_s: f64,
    silent_s: f64,
    contradicted_s: f64,
    level: Level,
    bar: Bar,
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
            absent_s: 0.0,
            unsure_s: 0.0,
            silent_s: f64::INFINITY,
            contradicted_s: 0.0,
            level: Level::default(),
            bar: Bar::default(),
        }
    }

    /// Whether there was no sound for a while.
    pub(crate) fn silent(&self) -> bool {
        self.silent_s > SILENCE_S
    }

    /// Takes how present music is, 0 to 1.
    pub(crate) fn music(&mut self, presence: f32) {
        self.presence = presence;
    }

    pub(crate) fn state(&self) -> BeatLock {
        self.state
    }

    /// Takes one hop of onsets, and what the network says of it.
    pub(crate) fn hop(&mut self, onset: &Onset, heard: &Heard) {
        let hop_s = 1.0 / RATE_HZ;
        self.silent_s = if onset.audible {
            0.0
        } else {
            self.silent_s + hop_s
        };
        self.tempogram.push(onset.strength);
        self.belief.hop(evidence(onset.strength));
        let phase = self.phase + self.bpm / 60.0 * hop_s;
        self.phase = phase.rem_euclid(1.0);
        self.level.count(phase.floor() as i64);
        let voices = [onset.groups[0], onset.groups[1], sigmoid(heard.beat)];
        self.level.hear(self.phase, self.bpm, voices);
        let (danced, _) = self.level.apply(self.phase, self.bpm);
        self.bar
            .hear(danced.rem_euclid(1.0), sigmoid(heard.downbeat));
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
        let clarity = if self.silent() {
            0.0
        } else {
            let regular = (self.fit.clarity - IRREGULAR) / (REGULAR - IRREGULAR);
            let music = (self.presence / MUSIC).min(1.0);
            music * ((estimate.mass - 0.15) / 0.6).clamp(0.0, 1.0) * regular.clamp(0.0, 1.0)
        };
        let pull = (2.0 * elapsed_s) as f32;
        self.confidence += pull.min(1.0) * (clarity - self.confidence);
        if self.silent() {
            self.confidence = 0.0;
        }
        self.absent_s = if self.presence > MUSIC {
            0.0
        } else {
            self.absent_s + elapsed_s
        };
        self.change_state(estimate, elapsed_s);
        match self.state {
            BeatLock::Lost => {
                self.phase = estimate.phase;
                self.bpm = estimate.bpm;
            }
            BeatLock::Locked | BeatLock::Holding => {
                self.follow(estimate, elapsed_s);
                if self.level.choose(self.bpm, elapsed_s) {
                    self.bar = Bar::default();
                }
            }
        }
    }

    fn change_state(&mut self, estimate: Estimate, elapsed_s: f64) {
        if self.silent() || self.absent_s > ABSENT_S {
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
                self.level.begin();
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
            if !self.level.carry_over(danced, self.phase, self.bpm) {
                self.bar = Bar::default();
            }
            self.contradicted_s = 0.0;
        }
    }

    /// Every reading of the beat `ahead_s` seconds after the newest hop; none
    /// without a beat.
    pub(crate) fn readings(&self, ahead_s: f64) -> Vec<LevelReading> {
        if self.state == BeatLock::Lost {
            return Vec::new();
        }
        let phase = self.phase + self.bpm / 60.0 * ahead_s;
        self.level.readings(phase, self.bpm)
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
            beat_in_bar: match self.state {
                BeatLock::Lost => None,
                BeatLock::Locked | BeatLock::Holding => self.bar.beat_in_bar(f64::from(phase)),
            },
        }
    }
}

/// A phase difference brought to -0.5..0.5.
fn wrap(phase: f64) -> f64 {
    phase - phase.round()
}
