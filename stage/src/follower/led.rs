//! One leader as its follower knows it: its clock, its music, whether it lives.

use super::{nanoseconds, seconds};
use crate::clock::StageClock;
use crate::lateness::Worst;
use crate::playout::Playout;
use crate::wire::Frames;
use std::collections::BTreeMap;

/// Silence after which a leader counts as lost: at least, at most, and in
/// between so many of the longest pauses of late. Seconds.
const PATIENCE_S: [f64; 2] = [0.45, 0.9];
const PAUSES: f64 = 3.0;
/// The same once a sign of life went away, which may be but one of two
/// connections: three frames.
const HASTE_S: f64 = 0.15;
/// Length of a beat while no tempo is known, seconds.
const USUAL_BEAT_S: f64 = 0.5;
/// What was sent before is asked for no more often than this, seconds.
const AGAIN_S: f64 = 0.4;

/// A leader as its follower knows it.
#[derive(Debug)]
pub(super) struct Led {
    pub instance: u64,
    pub term: u32,
    pub clock: StageClock,
    /// When it was heard last, and how long it paused of late.
    pub heard_ns: i64,
    pub pauses: Worst,
    pub ways: Worst,
    /// A token of the leader went away, and nothing was heard since.
    pub gone: bool,
    /// Newest number of each voice.
    pub newest: BTreeMap<u8, u64>,
    /// Voices by the style they dance.
    pub styles: BTreeMap<String, u8>,
    pub playout: Playout,
    /// Leader's clock less music time, nanoseconds, by the newest frame.
    pub music_start_ns: i64,
    pub lead_s: f64,
    pub beat_s: f64,
    pub roles_number: u64,
    pub ask_ns: i64,
    /// When it may be asked again for what it has sent.
    again_ns: i64,
}

impl Led {
    pub fn new(instance: u64, term: u32, now_ns: i64) -> Self {
        Self {
            instance,
            term,
            clock: StageClock::default(),
            heard_ns: now_ns,
            pauses: Worst::default(),
            ways: Worst::default(),
            gone: false,
            newest: BTreeMap::new(),
            styles: BTreeMap::new(),
            playout: Playout::default(),
            music_start_ns: 0,
            lead_s: 0.0,
            beat_s: USUAL_BEAT_S,
            roles_number: 0,
            ask_ns: i64::MIN,
            again_ns: i64::MIN,
        }
    }

    pub fn lives(&mut self, now_ns: i64) {
        self.pauses
            .note(now_ns, seconds(now_ns - self.heard_ns).max(0.0));
        self.heard_ns = self.heard_ns.max(now_ns);
        self.gone = false;
    }

    /// Takes frames in; gives how many of them are new.
    pub fn take(&mut self, frames: &Frames) -> usize {
        let playout = &mut self.playout;
        let new = { frames.numbered() }.filter(|(number, frame)| playout.push(*number, frame));
        new.count()
    }

    pub fn is_lost(&self, now_ns: i64) -> bool {
        let patience_s = match self.gone {
            true => HASTE_S,
            false => (PAUSES * self.pauses.of_late()).clamp(PATIENCE_S[0], PATIENCE_S[1]),
        };
        seconds(now_ns - self.heard_ns) > patience_s
    }

    /// Seconds of its music at a moment, if its clock and music are known.
    pub fn music_s(&self, now_ns: i64) -> Option<f64> {
        let estimate = self.clock.estimate()?;
        let known = !self.newest.is_empty();
        known.then(|| seconds(estimate.leader_ns(now_ns) - self.music_start_ns))
    }

    /// Whether to ask for frames that were sent before this robot came, or
    /// while it was cut off, and that are to be shown now.
    pub fn lacks(&mut self, now_ns: i64) -> bool {
        let from_ns = self.music_s(now_ns).map_or(i64::MIN, nanoseconds);
        let lacks = now_ns >= self.again_ns && self.playout.lacks(from_ns);
        if lacks {
            self.again_ns = now_ns + nanoseconds(AGAIN_S);
        }
        lacks
    }

    pub fn is_known(&self, now_ns: i64) -> bool {
        self.music_s(now_ns).is_some()
    }
}
