//! A steady stream from an unsteady input: mono, at [`LIVE_RATE_HZ`], as long as
//! the wall clock says, with or without sound.
//!
//! ```text
//!            patience over                        sound again
//! Sounding -----------------> Stalled (zeros) -------------------> Sounding
//! ```
//!
//! Time is passed in. A position is seconds of stream since the first sound; the
//! time stamps of the blocks give their position. A device whose clock runs a
//! little fast or slow is played a little slower or faster; a gap is filled with
//! silence ([`stall`](super::stall)), and sound that comes after silence took its
//! place is dropped. A program that writes PCM may be ahead of the clock (the
//! program waits for us); that is not corrected.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::clock::{JUMP_S, RateMeter, playing_speed, seconds_between};
use super::event::{CaptureEvent, CaptureStats};
use super::ring::RingReader;
use super::stall::{InputKind, Stall};
use super::supervisor::{DeviceSupervisor, SupervisorEvent};
use crate::features::ANALYSIS_RATE_HZ;
use crate::features::resampler::Resampler;

/// Samples a second of the stream.
pub(crate) const LIVE_RATE_HZ: u32 = ANALYSIS_RATE_HZ;

pub(crate) struct LiveStream {
    kind: InputKind,
    supervisor: DeviceSupervisor,
    ring: Option<RingReader>,
    /// Whether the device was open at the last event; its ring may end before
    /// the supervisor reports why.
    open: bool,
    rate_hz: u32,
    resampler: Resampler,
    created: Instant,
    /// When position 0 was captured.
    started: Option<Instant>,
    delivered: u64,
    /// When the newest sample of the stream was captured.
    newest: Option<Instant>,
    stall: Option<Stall>,
    /// Silence of the last gap whose sound may still come, seconds.
    owed_s: f64,
    rate_meter: RateMeter,
    lost_frames: u64,
    dropping: bool,
    over: bool,
    mono: Vec<f32>,
    events: VecDeque<CaptureEvent>,
    stats: CaptureStats,
}

impl LiveStream {
    /// The stream of the input that `supervisor` opens, from `now` on.
    pub(crate) fn new(kind: InputKind, supervisor: DeviceSupervisor, now: Instant) -> Self {
        Self {
            kind,
            supervisor,
            ring: None,
            open: false,
            rate_hz: LIVE_RATE_HZ,
            resampler: Resampler::new(LIVE_RATE_HZ, LIVE_RATE_HZ),
            created: now,
            started: None,
            delivered: 0,
            newest: None,
            stall: None,
            owed_s: 0.0,
            rate_meter: RateMeter::default(),
            lost_frames: 0,
            dropping: false,
            over: false,
            mono: Vec::new(),
            events: VecDeque::new(),
            stats: CaptureStats::default(),
        }
    }

    /// Appends the samples up to `now`; `false` once a PCM stream has ended.
    pub(crate) fn read(&mut self, now: Instant, out: &mut Vec<f32>) -> bool {
        while let Some(event) = self.supervisor.next_event() {
            self.handle(event, now);
        }
        self.read_ring(out);
        self.fill_stall(now, out);
        !self.over
    }

    /// Capture time of the sample at this position, if known.
    pub(crate) fn captured_at(&self, position_s: f64) -> Option<Instant> {
        let before_s = (self.position_s() - position_s).max(0.0);
        self.newest?.checked_sub(Duration::from_secs_f64(before_s))
    }

    pub(crate) fn next_event(&mut self) -> Option<CaptureEvent> {
        self.events.pop_front()
    }

    pub(crate) fn stats(&self) -> CaptureStats {
        self.stats
    }

    /// Seconds of stream so far, with the chunk in the resampler.
    fn position_s(&self) -> f64 {
        let gathered = self.resampler.gathered() as f64 / f64::from(self.rate_hz);
        self.delivered as f64 / f64::from(LIVE_RATE_HZ) + gathered
    }

    fn handle(&mut self, event: SupervisorEvent, now: Instant) {
        match event {
            SupervisorEvent::Opened(ring) => self.connect(ring),
            SupervisorEvent::Failed(reason) => {
                // Reported once, not at every attempt.
                self.ring = None;
                if std::mem::take(&mut self.open) {
                    self.events.push_back(CaptureEvent::Lost { reason });
                    self.begin_stall(now);
                }
            }
        }
    }

    pub(crate) fn connect(&mut self, ring: RingReader) {
        self.stats.opened += 1;
        self.change_rate(ring.format().sample_rate_hz, self.stats.opened > 1);
        self.lost_frames = 0;
        self.rate_meter.restart();
        self.ring = Some(ring);
        self.open = true;
    }

    fn change_rate(&mut self, to_hz: u32, tell: bool) {
        if to_hz == self.rate_hz {
            return;
        }
        if tell {
            let from_hz = self.rate_hz;
            self.events.push_back(CaptureEvent::RateChanged { from_hz, to_hz });
        }
        self.rate_hz = to_hz;
        self.resampler = Resampler::new(to_hz, LIVE_RATE_HZ);
    }

    fn read_ring(&mut self, out: &mut Vec<f32>) {
        let Some(mut ring) = self.ring.take() else {
            return;
        };
        let mut mono = std::mem::take(&mut self.mono);
        mono.clear();
        while let Some(captured) = ring.read(&mut mono) {
            self.play_block(&mono, captured, out);
            mono.clear();
        }
        self.mono = mono;
        self.note_overrun(&ring);
        let over = ring.is_over();
        self.over |= over && self.kind == InputKind::PcmStream;
        self.ring = (!over).then_some(ring);
    }

    /// Takes a block whose newest sample was captured at `captured`.
    fn play_block(&mut self, mono: &[f32], captured: Instant, out: &mut Vec<f32>) {
        let length_s = mono.len() as f64 / f64::from(self.rate_hz);
        let length = Duration::from_secs_f64(length_s);
        let begun = captured.checked_sub(length).unwrap_or(captured);
        let started = *self.started.get_or_insert(begun);
        if let Some(stall) = self.stall.take() {
            let away_s = stall.away_s(captured);
            self.events.push_back(CaptureEvent::Back { away_s });
        }
        let ahead_s = self.position_s() + seconds_between(begun, started);
        let skipped = self.correct_pace(ahead_s, mono.len());
        for &sample in &mono[skipped..] {
            self.play(sample, out);
        }
        self.newest = Some(captured);
        if self.kind == InputKind::Device {
            let measured = self.rate_meter.push(self.rate_hz, mono.len(), captured);
            if let Some(rate_hz) = measured {
                self.change_rate(rate_hz, true);
            }
        }
    }

    /// Brings the stream back to the clock; returns how many samples of the
    /// block are to be dropped.
    fn correct_pace(&mut self, ahead_s: f64, block: usize) -> usize {
        let droppable_s = match self.kind {
            InputKind::Device => f64::INFINITY,
            InputKind::PcmStream => self.owed_s,
        };
        let drop_s = if ahead_s > JUMP_S { ahead_s.min(droppable_s) } else { 0.0 };
        let drop = ((drop_s * f64::from(self.rate_hz)) as usize).min(block);
        if drop > 0 {
            let dropped_s = drop as f64 / f64::from(self.rate_hz);
            self.owed_s -= dropped_s;
            self.stats.dropped_s += dropped_s;
            if !std::mem::replace(&mut self.dropping, true) {
                self.events.push_back(CaptureEvent::TooLate);
            }
            return drop;
        }
        self.dropping = false;
        self.resampler.set_speed(playing_speed(ahead_s));
        0
    }

    /// No sound for too long: silence, as long as the clock says.
    fn fill_stall(&mut self, now: Instant, out: &mut Vec<f32>) {
        // A PCM stream begins with its first byte, a device at once.
        let waited = now.saturating_duration_since(self.created) > self.kind.patience();
        if self.started.is_none() && waited && self.kind == InputKind::Device {
            self.started = Some(self.created);
        }
        let Some(started) = self.started else {
            return;
        };
        let behind_s = seconds_between(started, now) - self.position_s();
        if self.stall.is_none() && behind_s > self.kind.patience().as_secs_f64() {
            self.events.push_back(CaptureEvent::Stalled);
            self.begin_stall(now);
        }
        let Some(stall) = &mut self.stall else {
            return;
        };
        if self.ring.is_some() && stall.reopens(now) {
            self.supervisor.reopen();
        }
        self.newest = Some(now);
        self.play_silence(behind_s.max(0.0), out);
    }

    fn begin_stall(&mut self, now: Instant) {
        self.stats.stalls += 1;
        self.owed_s = 0.0;
        self.rate_meter.restart();
        self.stall = Some(Stall::new(self.newest, now));
    }

    fn play_silence(&mut self, seconds: f64, out: &mut Vec<f32>) {
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

    fn note_overrun(&mut self, ring: &RingReader) {
        let lost = ring.lost_frames();
        if lost > self.lost_frames {
            let lost_s = (lost - self.lost_frames) as f64 / f64::from(self.rate_hz);
            self.lost_frames = lost;
            self.stats.overruns += 1;
            self.stats.lost_s += lost_s;
            self.events.push_back(CaptureEvent::Overrun { lost_s });
        }
    }
}
