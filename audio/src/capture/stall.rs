//! A stalled microphone or writer: what happens while no sound arrives.
//!
//! 1. After the [patience](InputKind::patience) silence takes the place of sound,
//!    at the pace of the wall clock: music time goes on, the beat is lost, the
//!    robot idles. The user is told once ([`CaptureEvent::Stalled`]).
//! 2. A device that is open and delivers nothing for [`REOPEN`] is closed and
//!    opened again, as often as that passes.
//! 3. When sound is back, the part of it that silence has already replaced is
//!    dropped ([`CaptureEvent::Back`], [`CaptureEvent::TooLate`]).
//!
//! [`LiveStream`](super::LiveStream) calls this at every read.

use std::time::{Duration, Instant};

use super::clock::seconds_between;

/// Stall after which a device is opened again.
const REOPEN: Duration = Duration::from_secs(3);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum InputKind {
    /// From a device, at the pace of its own clock, without end.
    Device,
    /// Written by another program at its own pace, until that program ends.
    PcmStream,
}

impl InputKind {
    /// How long sound may stay away before silence takes its place.
    pub(super) const fn patience(self) -> Duration {
        match self {
            InputKind::Device => Duration::from_millis(200),
            InputKind::PcmStream => Duration::from_millis(500),
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Stall {
    since: Instant,
    /// When the device was last told to open again.
    reopened: Instant,
}

impl Stall {
    /// A stall noticed `now`, after the newest sample at `newest`.
    pub(super) fn new(newest: Option<Instant>, now: Instant) -> Self {
        Self { since: newest.unwrap_or(now), reopened: now }
    }

    /// How long sound was away, seconds, when it is captured again.
    pub(super) fn away_s(&self, captured: Instant) -> f64 {
        seconds_between(self.since, captured)
    }

    /// Whether the device is to be opened again now.
    pub(super) fn reopens(&mut self, now: Instant) -> bool {
        let due = now.saturating_duration_since(self.reopened) > REOPEN;
        if due {
            self.reopened = now;
        }
        due
    }
}
