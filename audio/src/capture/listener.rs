//! Makes one steady stream of whatever arrives: mono, at [`LIVE_RATE_HZ`], as
//! long as the wall clock says, whether or not there is sound.
//!
//! ```text
//!            patience over                        sound again
//! Hearing ------------------> Silent (zeros) --------------------> Hearing
//! ```
//!
//! Time is passed in. A position is seconds of stream since the first sound;
//! the sound's own time stamps say where it belongs. A device whose clock runs
//! a little fast or slow is played a little slower or faster (`TAU_S`); a gap
//! is filled with silence, and what comes after silence took its place is left
//! out. A pipe may be ahead of the clock (its writer waits for us) and is then
//! left alone.

use super::keeper::{Keeper, LinkEvent};
use super::link::LinkReader;
use super::{CaptureStats, Notice};
use crate::ANALYSIS_RATE_HZ;
use crate::resample::Resampler;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Samples a second of the stream: those of the analysis, so that sound is
/// resampled once.
pub(crate) const LIVE_RATE_HZ: u32 = ANALYSIS_RATE_HZ;

/// Time over which an error of the pace is corrected, seconds.
const TAU_S: f64 = 10.0;
/// Most by which sound is played faster or slower.
const MAX_BEND: f64 = 0.005;
/// Errors of the pace beyond this are jumps, not drift, seconds.
const JUMP_S: f64 = 0.05;
/// Silence after which the device is opened again.
const REOPEN: Duration = Duration::from_secs(3);
/// Time over which the rate of a device is measured, seconds.
const RATE_WINDOW_S: f64 = 1.0;
/// A measured rate that is further off than this is another rate.
const RATE_TOLERANCE: f64 = 0.02;
/// Rates that devices have.
const USUAL_RATES_HZ: [u32; 9] = [
    8_000, 16_000, 22_050, 32_000, 44_100, 48_000, 88_200, 96_000, 192_000,
];

/// How sound comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// At the pace of its own clock, for ever.
    Device,
    /// As another program writes it, until that program ends.
    Pipe,
}

impl Kind {
    /// How long sound may stay away before silence takes its place.
    const fn patience(self) -> Duration {
        match self {
            Kind::Device => Duration::from_millis(200),
            Kind::Pipe => Duration::from_millis(500),
        }
    }
}

/// Silence in place of sound.
#[derive(Clone, Copy, Debug)]
struct Silence {
    since: Instant,
    /// When the device was last told to open again.
    reopened: Instant,
}

/// Frames counted over a while, to measure their rate.
#[derive(Clone, Copy, Debug)]
struct Count {
    since: Instant,
    frames: usize,
}

/// Listens to one source.
pub(crate) struct Listener {
    kind: Kind,
    keeper: Keeper,
    link: Option<LinkReader>,
    /// Whether the device was open when last heard of; its link may end before
    /// the keeper says why.
    open: bool,
    rate_hz: u32,
    resampler: Resampler,
    created: Instant,
    /// When position 0 was captured.
    started: Option<Instant>,
    /// Samples of the stream so far.
    delivered: u64,
    /// When the newest sample of the stream was captured.
    newest: Option<Instant>,
    silence: Option<Silence>,
    /// Silence given in the last gap that a pipe may still owe, seconds.
    owed_s: f64,
    count: Option<Count>,
    /// A measured rate that differs, until it is confirmed.
    suspect_hz: Option<f64>,
    lost_frames: u64,
    dropping: bool,
    over: bool,
    mono: Vec<f32>,
    notices: VecDeque<Notice>,
    stats: CaptureStats,
}

impl Listener {
    /// A listener to what `keeper` opens; `now` is when listening begins.
    pub(crate) fn new(kind: Kind, keeper: Keeper, now: Instant) -> Self {
        Self {
            kind,
            keeper,
            link: None,
            open: false,
            rate_hz: LIVE_RATE_HZ,
            resampler: Resampler::new(LIVE_RATE_HZ, LIVE_RATE_HZ),
            created: now,
            started: None,
            delivered: 0,
            newest: None,
            silence: None,
            owed_s: 0.0,
            count: None,
            suspect_hz: None,
            lost_frames: 0,
            dropping: false,
            over: false,
            mono: Vec::new(),
            notices: VecDeque::new(),
            stats: CaptureStats::default(),
        }
    }

    /// Appends what there is at `now`; `false` once a pipe has ended.
    pub(crate) fn take(&mut self, now: Instant, out: &mut Vec<f32>) -> bool {
        while let Some(event) = self.keeper.next_event() {
            self.handle(event, now);
        }
        self.hear_all(out);
        self.keep_pace(now, out);
        !self.over
    }

    /// When the sample at this position was captured, as far as is known.
    pub(crate) fn captured_at(&self, position_s: f64) -> Option<Instant> {
        let before_s = (self.position_s() - position_s).max(0.0);
        self.newest?.checked_sub(Duration::from_secs_f64(before_s))
    }

    /// The next thing that a user should know.
    pub(crate) fn next_notice(&mut self) -> Option<Notice> {
        self.notices.pop_front()
    }

    /// Totals so far.
    pub(crate) fn stats(&self) -> CaptureStats {
        self.stats
    }

    /// Seconds of stream so far, with the chunk that is being gathered.
    fn position_s(&self) -> f64 {
        let gathered = self.resampler.gathered() as f64 / f64::from(self.rate_hz);
        self.delivered as f64 / f64::from(LIVE_RATE_HZ) + gathered
    }

    fn handle(&mut self, event: LinkEvent, now: Instant) {
        match event {
            LinkEvent::Opened(link) => self.connect(link),
            LinkEvent::Failed(reason) => {
                // Said once, not at every attempt.
                self.link = None;
                if std::mem::take(&mut self.open) {
                    self.notices.push_back(Notice::Lost { reason });
                    self.fall_silent(now);
                }
            }
        }
    }

    /// Hears this link from now on.
    pub(crate) fn connect(&mut self, link: LinkReader) {
        self.stats.opened += 1;
        self.change_rate(link.format().sample_rate_hz, self.stats.opened > 1);
        self.lost_frames = 0;
        self.count = None;
        self.link = Some(link);
        self.open = true;
    }

    fn change_rate(&mut self, to_hz: u32, tell: bool) {
        if to_hz == self.rate_hz {
            return;
        }
        if tell {
            let from_hz = self.rate_hz;
            self.notices
                .push_back(Notice::RateChanged { from_hz, to_hz });
        }
        self.rate_hz = to_hz;
        self.resampler = Resampler::new(to_hz, LIVE_RATE_HZ);
    }

    fn hear_all(&mut self, out: &mut Vec<f32>) {
        let Some(mut link) = self.link.take() else {
            return;
        };
        let mut mono = std::mem::take(&mut self.mono);
        mono.clear();
        while let Some(captured) = link.read(&mut mono) {
            self.hear(&mono, captured, out);
            mono.clear();
        }
        self.mono = mono;
        self.note_overrun(&link);
        let over = link.is_over();
        self.over |= over && self.kind == Kind::Pipe;
        self.link = (!over).then_some(link);
    }

    /// Takes a block whose newest sample was captured at `captured`.
    fn hear(&mut self, mono: &[f32], captured: Instant, out: &mut Vec<f32>) {
        let length_s = mono.len() as f64 / f64::from(self.rate_hz);
        let length = Duration::from_secs_f64(length_s);
        let begun = captured.checked_sub(length).unwrap_or(captured);
        let started = *self.started.get_or_insert(begun);
        if let Some(silence) = self.silence.take() {
            let away_s = seconds_between(silence.since, captured);
            self.notices.push_back(Notice::Back { away_s });
        }
        let ahead_s = self.position_s() + seconds_between(begun, started);
        let skipped = self.correct_pace(ahead_s, mono.len());
        for &sample in &mono[skipped..] {
            self.play(sample, out);
        }
        self.newest = Some(captured);
        self.measure_rate(mono.len(), captured);
    }

    /// Brings the stream back to the clock; returns how many samples of the
    /// block at hand are to be left out.
    fn correct_pace(&mut self, ahead_s: f64, block: usize) -> usize {
        let droppable_s = match self.kind {
            Kind::Device => f64::INFINITY,
            Kind::Pipe => self.owed_s,
        };
        let drop_s = if ahead_s > JUMP_S {
            ahead_s.min(droppable_s)
        } else {
            0.0
        };
        let drop = ((drop_s * f64::from(self.rate_hz)) as usize).min(block);
        if drop > 0 {
            let dropped_s = drop as f64 / f64::from(self.rate_hz);
            self.owed_s -= dropped_s;
            self.stats.dropped_s += dropped_s;
            if !std::mem::replace(&mut self.dropping, true) {
                self.notices.push_back(Notice::TooLate);
            }
            return drop;
        }
        self.dropping = false;
        // What remains ahead is a pipe whose writer waits for us.
        let late_s = if ahead_s > JUMP_S { 0.0 } else { ahead_s };
        let bend = (late_s / TAU_S).clamp(-MAX_BEND, MAX_BEND);
        self.resampler.set_speed(1.0 + bend);
        0
    }

    /// No sound for too long: silence, as long as the clock says.
    fn keep_pace(&mut self, now: Instant, out: &mut Vec<f32>) {
        // A pipe owes nothing before its first byte.
        let waited = now.saturating_duration_since(self.created) > self.kind.patience();
        if self.started.is_none() && waited && self.kind == Kind::Device {
            self.started = Some(self.created);
        }
        let Some(started) = self.started else {
            return;
        };
        let behind_s = seconds_between(started, now) - self.position_s();
        if self.silence.is_none() && behind_s > self.kind.patience().as_secs_f64() {
            self.notices.push_back(Notice::Stalled);
            self.fall_silent(now);
        }
        let Some(silence) = &mut self.silence else {
            return;
        };
        if self.link.is_some() && now.saturating_duration_since(silence.reopened) > REOPEN {
            silence.reopened = now;
            self.keeper.reopen();
        }
        self.newest = Some(now);
        self.silence_for(behind_s.max(0.0), out);
    }

    fn fall_silent(&mut self, now: Instant) {
        self.stats.stalls += 1;
        self.owed_s = 0.0;
        self.count = None;
        let since = self.newest.unwrap_or(now);
        self.silence = Some(Silence {
            since,
            reopened: now,
        });
    }

    fn silence_for(&mut self, seconds: f64, out: &mut Vec<f32>) {
        let samples = (seconds * f64::from(self.rate_hz)) as usize;
        self.resampler.set_speed(1.0);
        for _ in 0..samples {
            self.play(0.0, out);
        }
        let silent_s = samples as f64 / f64::from(self.rate_hz);
        self.stats.silence_s += silent_s;
        self.owed_s += silent_s;
    }

    fn play(&mut self, sample: f32, out: &mut Vec<f32>) {
        let before = out.len();
        self.resampler.push(sample, |s| out.push(s));
        self.delivered += (out.len() - before) as u64;
    }

    /// A device that says one rate and delivers another is believed only its
    /// deeds, once two measurements agree.
    fn measure_rate(&mut self, frames: usize, captured: Instant) {
        if self.kind != Kind::Device {
            return;
        }
        let Some(count) = &mut self.count else {
            let since = captured;
            self.count = Some(Count { since, frames: 0 });
            return;
        };
        count.frames += frames;
        let window_s = seconds_between(count.since, captured);
        if window_s < RATE_WINDOW_S {
            return;
        }
        let measured_hz = count.frames as f64 / window_s;
        self.count = None;
        let off = |rate_hz: f64| (measured_hz / rate_hz - 1.0).abs();
        if off(f64::from(self.rate_hz)) < RATE_TOLERANCE {
            self.suspect_hz = None;
        } else if self
            .suspect_hz
            .is_some_and(|suspect| off(suspect) < RATE_TOLERANCE / 2.0)
        {
            self.suspect_hz = None;
            self.change_rate(nearest_usual_rate(measured_hz), true);
        } else {
            self.suspect_hz = Some(measured_hz);
        }
    }

    fn note_overrun(&mut self, link: &LinkReader) {
        let lost = link.lost_frames();
        if lost > self.lost_frames {
            let lost_s = (lost - self.lost_frames) as f64 / f64::from(self.rate_hz);
            self.lost_frames = lost;
            self.stats.overruns += 1;
            self.stats.lost_s += lost_s;
            self.notices.push_back(Notice::Overrun { lost_s });
        }
    }
}

/// Seconds from one moment to another; below zero if the other is earlier.
fn seconds_between(from: Instant, to: Instant) -> f64 {
    match to.checked_duration_since(from) {
        Some(after) => after.as_secs_f64(),
        None => -from.duration_since(to).as_secs_f64(),
    }
}

/// The rate that a device most likely has.
fn nearest_usual_rate(measured_hz: f64) -> u32 {
    let near = |rate: &u32| (measured_hz / f64::from(*rate) - 1.0).abs() < 0.01;
    let usual = USUAL_RATES_HZ.into_iter().find(near);
    usual.unwrap_or((measured_hz.round() as u32).clamp(4_000, 384_000))
}

#[cfg(test)]
#[path = "listener_tests.rs"]
mod tests;
