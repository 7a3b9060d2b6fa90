//! The causal beat tracker: a steady oscillator that follows the bar pointer.
//!
//! ```text
//!            confident                unsure
//!   Lost ----------------> Locked <=========> Holding
//!    ^                     (follows)          (coasts on)
//!    |                         |                  |
//!    +-- silence, no music ----+- unsure HOLD_S --+
//! ```
//!
//! While locked the oscillator follows the pointer's estimate by small
//! corrections, so that its phase never jumps for one late drum. An estimate
//! that contradicts the oscillator for a while is taken over, however long the
//! oscillator was followed, and that is told before.

use super::bar_pointer::{BarEstimate, BarPointer, RATE_HZ};
use super::beat_evidence::{Listener, OnsetBeat, StepOnset};
use super::network::NetworkOutput;
use super::tempo_range::TempoRange;
use servodance_types::{Beat, BeatLock, FRAME_RATE_HZ};

/// Confidence that locks, and confidence below which a lock only holds.
const LOCK: f32 = 0.4;
const UNLOCK: f32 = 0.25;
/// How far from a tapped beat an estimate of it may be, beats.
const TAPPED_OFF: f64 = 0.1;
/// Least confidence in a beat that was tapped just now.
const TAPPED: f32 = 0.7;
/// Presence of music that a lock needs, and how long it may be absent.
const MUSIC: f32 = 0.5;
const ABSENT_S: f64 = 4.0;
/// Mean probability of a beat at the beats, by the network: of noise and of music.
const FAINT: f32 = 0.06;
const CLEAR: f32 = 0.25;
/// Weight of the newest beat in that mean.
const NEWEST: f32 = 0.2;
/// Longest hold without confidence.
const HOLD_S: f64 = 7.0;
/// Silence that ends the music.
const SILENCE_S: f64 = 1.5;
/// An estimate within these agrees with the oscillator: logarithm of tempo, beats.
const SAME_TEMPO: f64 = 0.06;
const SAME_BEAT: f64 = 0.15;
/// How long a contradicting estimate must last before it is taken over.
const PATIENCE_S: f64 = 0.3;
/// ... and from when on the change is told. A bar line is not waited for: that cost more
/// beats than it saved.
const TOLD_S: f64 = 0.1;
/// Probability that such an estimate must have.
const SURE: f32 = 0.5;
/// Probability of a place in the bar from which on it is told.
const BAR: f32 = 0.35;
/// Log-odds that a beat opens its bar, for a change of tones that is one deviation above the
/// mean of all beats; the change that says nothing; bound of changes in deviations.
const CHANGE: f32 = 0.35;
const USUAL_CHANGE: f32 = 0.15;
const CHANGES: f32 = 2.0;
/// Mean steadiness of tones from which on changes are listened to in full: drums have none.
const TONAL: f32 = 0.3;
/// Weight of the newest beat in mean and deviation.
const NEWEST_CHANGE: f32 = 0.1;
/// Share of the phase error that is corrected in one second.
const PHASE_PULL_PER_S: f64 = 2.7;
/// Change of tempo, in beats a second per second, for a phase error of one.
const LAG_PULL_PER_S2: f64 = 1.3;
/// Share of the tempo error that is corrected in one second.
const TEMPO_PULL_PER_S: f64 = 0.8;
/// Shortest and longest time between two taps of one run.
const TAPS_S: (f64, f64) = (0.26, 1.25);
/// Steps between two comparisons of the oscillator with the pointer.
const UPDATE_EVERY: u64 = 8;

pub(crate) struct Tracker {
    listener: Listener,
    pointer: BarPointer,
    estimate: BarEstimate,
    steps: u64,
    state: BeatLock,
    phase: f64,
    bpm: f64,
    /// Place of the last beat in its bar.
    place: i64,
    confidence: f32,
    presence: f32,
    strength: f32,
    peak: f32,
    absent_s: f64,
    unsure_s: f64,
    silent_s: f64,
    contradicted_s: f64,
    taps: Taps,
    tones: TonesAtBeats,
}

/// How steady tones are across a beat: less where harmony changes, most often at bar lines.
#[derive(Clone, Copy)]
struct TonesAtBeats {
    mean: f32,
    variance: f32,
}

impl TonesAtBeats {
    /// Log-odds that a beat with such tones opens its bar.
    fn opens_bar(&self, steady: f32) -> f32 {
        let change = (self.mean - steady) / self.variance.max(1e-4).sqrt();
        let tonal = (self.mean / TONAL).clamp(0.0, 1.0);
        tonal * CHANGE * (change.clamp(-CHANGES, CHANGES) - USUAL_CHANGE)
    }

    fn take(&mut self, steady: f32) {
        let off = steady - self.mean;
        self.mean += NEWEST_CHANGE * off;
        self.variance += NEWEST_CHANGE * (off * off - self.variance);
    }
}

/// What a listener taps.
#[derive(Default)]
struct Taps {
    /// First and last of a run, seconds of steps, and the beats between them.
    first_s: f64,
    last_s: Option<f64>,
    beats: u32,
    /// Whether the beat that is followed was tapped.
    hold: bool,
}

impl Taps {
    /// The period of the run that a tap at this time continues.
    fn take(&mut self, at_s: f64) -> Option<f64> {
        let since_s = self.last_s.map(|last_s| at_s - last_s);
        self.last_s = Some(at_s);
        if since_s.is_some_and(|s| (TAPS_S.0..=TAPS_S.1).contains(&s)) {
            self.beats += 1;
            return Some((at_s - self.first_s) / f64::from(self.beats));
        }
        (self.first_s, self.beats) = (at_s, 0);
        None
    }
}

impl Tracker {
    pub(crate) fn new() -> Self {
        let mut pointer = BarPointer::new();
        Self {
            listener: Listener::new(),
            estimate: pointer.estimate(),
            pointer,
            steps: 0,
            state: BeatLock::Lost,
            phase: 0.0,
            bpm: 0.0,
            place: 0,
            confidence: 0.0,
            presence: 0.0,
            strength: 0.0,
            peak: 0.0,
            absent_s: 0.0,
            unsure_s: 0.0,
            silent_s: f64::INFINITY,
            contradicted_s: 0.0,
            taps: Taps::default(),
            tones: TonesAtBeats { mean: 0.5, variance: 0.05 },
        }
    }

    pub(crate) fn is_silent(&self) -> bool {
        self.silent_s > SILENCE_S
    }

    pub(crate) fn set_presence(&mut self, presence: f32) {
        self.presence = presence;
    }

    /// Follows no other tempi.
    pub(crate) fn limit_tempo(&mut self, tempo: TempoRange) {
        self.pointer.limit_tempo(tempo);
    }

    /// A listener's tap on a beat that was audible `ago_s` before the newest step. The
    /// second of a run puts tempo and phase right; they are kept until the music ends.
    pub(crate) fn tap(&mut self, ago_s: f64) {
        let Some(period_s) = self.taps.take(self.steps as f64 / RATE_HZ - ago_s) else {
            return;
        };
        self.pointer.anchor(ago_s, period_s);
        self.estimate = self.pointer.estimate();
        self.taps.hold = true;
        self.state = BeatLock::Locked;
        self.confidence = self.confidence.max(TAPPED);
        self.take_over();
    }

    /// Mean probability of a beat, by the network, at the beats; of the pointer's beats
    /// while none is followed.
    pub(crate) fn strength(&self) -> f32 {
        self.strength
    }

    pub(crate) fn state(&self) -> BeatLock {
        self.state
    }

    /// One step of the network: its output, the strongest onsets in it, whether
    /// anything was audible.
    pub(crate) fn step(
        &mut self,
        output: &NetworkOutput,
        onset: StepOnset,
        guess: OnsetBeat,
        audible: bool,
    ) {
        let step_s = 1.0 / RATE_HZ;
        self.silent_s = if audible { 0.0 } else { self.silent_s + step_s };
        let evidence = self.listener.hear(output, onset, guess);
        self.pointer.step(&evidence);
        let phase = self.phase + self.bpm / 60.0 * step_s;
        self.place += phase.floor() as i64;
        self.phase = phase.rem_euclid(1.0);
        self.weigh_beat(evidence.heard);
        self.steps += 1;
        if self.steps.is_multiple_of(UPDATE_EVERY) {
            self.estimate = self.pointer.estimate();
            self.update(UPDATE_EVERY as f64 * step_s);
        }
    }

    /// Once a frame, how steady the tones were from before to after a time `ago_s` before the
    /// newest step.
    pub(crate) fn hear_tones(&mut self, steady: f32, ago_s: f64) {
        if self.state == BeatLock::Lost {
            return;
        }
        let frame_s = 1.0 / FRAME_RATE_HZ;
        self.pointer.weigh_bars(self.tones.opens_bar(steady), ago_s, frame_s);
        let then = self.phase - self.bpm / 60.0 * ago_s;
        if then - then.floor() < self.bpm / 60.0 * frame_s {
            self.tones.take(steady);
        }
    }

    /// The mean of the network's beats where the oscillator has its own.
    fn weigh_beat(&mut self, heard: f32) {
        let off_s = (self.phase - self.phase.round()).abs() * 60.0 / self.bpm.max(1.0);
        if off_s < 0.04 {
            self.peak = self.peak.max(heard);
        } else if self.peak > 0.0 {
            self.strength += NEWEST * (self.peak - self.strength);
            self.peak = 0.0;
        }
    }

    fn update(&mut self, elapsed_s: f64) {
        let estimate = self.estimate;
        let clear = ((self.strength - FAINT) / (CLEAR - FAINT)).clamp(0.0, 1.0);
        // Of a tapped beat a person is sure.
        let clear = if self.taps.hold { 1.0 } else { clear };
        let music = (self.presence / MUSIC).min(1.0);
        let clarity = music * clear * ((estimate.mass - 0.2) / 0.5).clamp(0.0, 1.0);
        let pull = (2.0 * elapsed_s) as f32;
        self.confidence += pull.min(1.0) * (clarity - self.confidence);
        if self.is_silent() {
            self.confidence = 0.0;
        }
        self.absent_s = if self.presence > MUSIC { 0.0 } else { self.absent_s + elapsed_s };
        self.change_state(elapsed_s);
        if self.state == BeatLock::Lost {
            self.taps.hold = false;
        } else if self.taps.hold {
            self.pointer.keep_near(self.phase, self.bpm);
        }
        match self.state {
            BeatLock::Lost => self.take_over(),
            _ => self.follow(elapsed_s),
        }
    }

    fn change_state(&mut self, elapsed_s: f64) {
        if self.is_silent() || self.absent_s > ABSENT_S {
            self.state = BeatLock::Lost;
            return;
        }
        match self.state {
            BeatLock::Lost if self.confidence > LOCK && self.presence > MUSIC => {
                self.state = BeatLock::Locked;
                self.unsure_s = 0.0;
                self.take_over();
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

    fn take_over(&mut self) {
        self.phase = self.estimate.phase;
        self.bpm = self.estimate.bpm;
        self.contradicted_s = 0.0;
        self.take_bar();
    }

    /// The place in the bar that is nearest to the estimate's.
    fn take_bar(&mut self) {
        let estimate = f64::from(self.estimate.beat) + self.estimate.phase;
        self.place = (estimate - self.phase).round() as i64;
    }

    fn follow(&mut self, elapsed_s: f64) {
        let estimate = self.estimate;
        let error = wrap(estimate.phase - self.phase);
        let tempo_error = (estimate.bpm / self.bpm).ln();
        // An estimate at the border of what a tap allows is of another beat.
        if self.taps.hold && error.abs() > TAPPED_OFF {
            return;
        }
        if tempo_error.abs() < SAME_TEMPO && error.abs() < SAME_BEAT {
            self.contradicted_s = 0.0;
            let trust = f64::from(self.confidence);
            let phase = self.phase + (PHASE_PULL_PER_S * elapsed_s * trust).min(1.0) * error;
            self.phase = phase.rem_euclid(1.0);
            // The integral part, without which a wrong tempo would leave a lag.
            self.bpm += 60.0 * LAG_PULL_PER_S2 * elapsed_s * trust * error;
            self.bpm *= (TEMPO_PULL_PER_S * elapsed_s * trust * tempo_error).exp();
            self.take_bar();
            return;
        }
        if estimate.mass > SURE {
            self.contradicted_s += elapsed_s;
        }
        if self.contradicted_s > PATIENCE_S {
            self.take_over();
        }
    }

    /// Another beat is heard, and is followed if that lasts.
    fn is_changing(&self) -> bool {
        self.state != BeatLock::Lost && self.contradicted_s > TOLD_S
    }

    /// The beat `ahead_s` seconds after the newest step.
    pub(crate) fn beat(&self, ahead_s: f64) -> Beat {
        if self.bpm <= 0.0 || self.confidence <= 0.0 {
            return Beat::default();
        }
        let whole = self.phase + self.bpm / 60.0 * ahead_s;
        let phase = whole.rem_euclid(1.0) as f32;
        let place = self.place + whole.floor() as i64;
        let meter = self.estimate.meter;
        let heard = self.state != BeatLock::Lost;
        let bar = (heard && self.estimate.bar_mass > BAR).then_some(meter);
        Beat {
            phase: if phase < 1.0 { phase } else { 0.0 },
            tempo_bpm: self.bpm as f32,
            confidence: self.confidence,
            lock: if self.is_changing() { BeatLock::Changing } else { self.state },
            beat_in_bar: bar.map(|beats| place.rem_euclid(i64::from(beats)) as u8),
            beats_in_bar: bar,
            bar_confidence: if heard { self.estimate.bar_mass } else { 0.0 },
        }
    }
}

/// A phase difference brought to -0.5..0.5.
fn wrap(phase: f64) -> f64 {
    phase - phase.round()
}
