//! A leader as its follower tracks it: clock, music, frames, signs of life.

use super::jitter_buffer::JitterBuffer;
use crate::clock::{LeaderClock, RollingMax, nanoseconds, seconds};
use crate::messages::Frames;
use std::collections::BTreeMap;

/// Silence after which a leader counts as lost, seconds: this many of the longest
/// recent pauses, within these bounds.
const PAUSES: f64 = 3.0;
const TIMEOUT_S: [f64; 2] = [0.45, 0.9];
/// The same after a liveliness token (of one of two connections) is gone, seconds.
const GONE_TIMEOUT_S: f64 = 0.15;
/// Length of a beat while the tempo is unknown, seconds.
const DEFAULT_BEAT_S: f64 = 0.5;
/// Shortest interval between two requests to resend frames, seconds.
const RESEND_S: f64 = 0.4;

#[derive(Debug)]
pub(super) struct TrackedLeader {
    pub instance: u64,
    pub term: u32,
    pub clock: LeaderClock,
    pub received_ns: i64,
    pub pauses: RollingMax,
    pub transits: RollingMax,
    /// A token of the leader is gone, and no message has arrived since.
    pub gone: bool,
    /// Newest frame number of each channel.
    pub newest: BTreeMap<u8, u64>,
    /// Channels by their style.
    pub styles: BTreeMap<String, u8>,
    pub buffer: JitterBuffer,
    /// Leader's clock less music time, nanoseconds, by the newest frame.
    pub music_start_ns: i64,
    pub lead_s: f64,
    pub beat_s: f64,
    pub roles_number: u64,
    /// When the next time request is due.
    pub request_ns: i64,
    /// When the next request to resend is allowed.
    resend_ns: i64,
}

impl TrackedLeader {
    pub fn new(instance: u64, term: u32, now_ns: i64) -> Self {
        Self {
            instance,
            term,
            clock: LeaderClock::default(),
            received_ns: now_ns,
            pauses: RollingMax::default(),
            transits: RollingMax::default(),
            gone: false,
            newest: BTreeMap::new(),
            styles: BTreeMap::new(),
            buffer: JitterBuffer::default(),
            music_start_ns: 0,
            lead_s: 0.0,
            beat_s: DEFAULT_BEAT_S,
            roles_number: 0,
            request_ns: i64::MIN,
            resend_ns: i64::MIN,
        }
    }

    /// Notes a message, which is a sign of life.
    pub fn mark_alive(&mut self, now_ns: i64) {
        let pause_s = seconds(now_ns - self.received_ns).max(0.0);
        self.pauses.push(now_ns, pause_s);
        self.received_ns = self.received_ns.max(now_ns);
        self.gone = false;
    }

    /// Takes frames; returns how many of them are new.
    pub fn take(&mut self, frames: &Frames) -> usize {
        let buffer = &mut self.buffer;
        let new = { frames.numbered() }.filter(|(number, frame)| buffer.push(*number, frame));
        new.count()
    }

    pub fn is_lost(&self, now_ns: i64) -> bool {
        let timeout_s = match self.gone {
            true => GONE_TIMEOUT_S,
            false => (PAUSES * self.pauses.max()).clamp(TIMEOUT_S[0], TIMEOUT_S[1]),
        };
        seconds(now_ns - self.received_ns) > timeout_s
    }

    /// Music time of the leader in seconds, if its clock and music are known.
    pub fn music_s(&self, now_ns: i64) -> Option<f64> {
        let estimate = self.clock.estimate()?;
        let known = !self.newest.is_empty();
        known.then(|| seconds(estimate.leader_ns(now_ns) - self.music_start_ns))
    }

    /// Whether to request frames that were sent before this follower joined, or
    /// while it was cut off, and that are due now.
    pub fn needs_resend(&mut self, now_ns: i64) -> bool {
        let from_ns = self.music_s(now_ns).map_or(i64::MIN, nanoseconds);
        let lacks = now_ns >= self.resend_ns && self.buffer.lacks(from_ns);
        if lacks {
            self.resend_ns = now_ns + nanoseconds(RESEND_S);
        }
        lacks
    }

    pub fn is_known(&self, now_ns: i64) -> bool {
        self.music_s(now_ns).is_some()
    }
}
