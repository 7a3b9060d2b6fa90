//! A follower: which leader to follow, the leader's time, the next frame.
//!
//! ```text
//!            frames, replies             other leader or channel, far off
//!   Alone -------------------> Following -----------------------------> Leaving
//!     ^                         |  ^                                       |
//!     |              silent: v  |  |  messages again                       |
//!     +------ hidden --------- Fading                                      |
//!     +-------------------- the motion is hidden --------------------------+
//! ```
//!
//! - While fading the robot dances the frames sent before, so that a short silence
//!   is only a dip in the movement.
//! - One leader is followed at a time. Another one replaces it when the first is
//!   silent, or when the term of the other is higher (it took over); and only once
//!   the other has replied to requests with their nonces, which a recording of an
//!   old leader cannot.
//! - A leader that was left for another is never followed again; messages whose
//!   number is not higher than the last are dropped.
//! - Motion begins, ends and changes over only while the motion is hidden (the
//!   robot idles), so that nothing jumps.
//!
//! Times are nanoseconds of the follower's clock. *Motion time* is the time of the
//! frames handed out: seconds on the 20 Hz grid, growing from one leader to the
//! next.

mod jitter_buffer;
mod receive;
mod stats;
mod tracked_leader;

pub use stats::{DropCounters, FollowerStats};

use crate::clock::{nanoseconds, seconds};
use crate::messages::{FollowerReport, Message, Role, StageStop, TimeRequest};
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use servodance_types::{FRAME_RATE_HZ, MotionFrame, MusicFrame, Posture};
use std::collections::VecDeque;
use tracked_leader::TrackedLeader;

/// Interval of time requests: for the first [`SETTLED`] exchanges, and later, seconds.
const REQUEST_SOON_S: f64 = 0.06;
const REQUEST_S: f64 = 0.25;
const SETTLED: usize = 12;
/// Interval of reports, seconds.
const REPORT_S: f64 = 0.5;
/// Frames are handed out this long before they are needed, seconds.
const SOON_S: f64 = 0.25;
/// The same for frames before which others are missing, seconds.
const NOW_S: f64 = 0.06;
/// Allowance for handing a frame over, seconds.
const HAND_OVER_S: f64 = 0.1;
/// Factor on the longest recent transit: a segment that is lost twice takes TCP
/// three times as long.
const RESERVE: f64 = 2.5;
/// Motion begins this long before the due time, seconds.
const RUN_UP_S: f64 = 0.3;
/// Gap between the motion of two leaders, seconds: more than a retargeter bridges.
const BETWEEN_S: f64 = 2.0;
/// Error of the shown time beyond which the motion restarts, seconds.
const FAR_S: f64 = 3.0;
/// Largest number of open requests, and of leaders that were left.
const PENDING: usize = 64;
const RETIRED: usize = 16;

/// A frame whose turn it is, in motion time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlayoutFrame {
    /// Pose and contacts at the frame's motion time.
    pub motion: MotionFrame,
    /// The music that it was made for.
    pub music: MusicFrame,
    /// Baseline posture of the dancer.
    pub posture: Posture,
}

/// The moment of the motion that is due at the servos, as a line over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlayoutTime {
    /// Time of the estimate, nanoseconds of the follower's clock.
    pub at_ns: i64,
    /// Motion time that is due then, seconds.
    pub motion_s: f64,
    /// Seconds of motion a second of the follower's clock.
    pub rate: f64,
}

impl PlayoutTime {
    /// Motion time that is due at a time of the follower's clock, seconds.
    pub fn at(&self, now_ns: i64) -> f64 {
        self.motion_s + self.rate * seconds(now_ns.saturating_sub(self.at_ns))
    }
}

/// A follower: one robot of the stage.
#[derive(Debug)]
pub struct Follower {
    id: u64,
    name: String,
    /// Look-ahead of the retargeter beyond the due time, seconds.
    reach_s: f64,
    rng: StdRng,
    current: Option<TrackedLeader>,
    candidate: Option<TrackedLeader>,
    retired: VecDeque<u64>,
    /// Open requests: nonce, instance, time.
    pending: VecDeque<(u64, u64, i64)>,
    /// Motion time less music time of the current leader, seconds.
    base_s: f64,
    channel: u8,
    /// The motion is being hidden.
    leaving: bool,
    /// Motion time of the newest frame that was handed out.
    newest_s: f64,
    /// The role without a cue of the present leader.
    started: Role,
    role: Role,
    report_number: u32,
    report_ns: i64,
    stops: u64,
    stopped_by: VecDeque<StageStop>,
    stats: FollowerStats,
}

impl Follower {
    /// A follower with this role until a cue changes it. `reach_s`: look-ahead of
    /// the retargeter beyond the due time; `seed`: secret seed of its nonces.
    pub fn new(name: &str, role: Role, reach_s: f64, seed: [u8; 32]) -> Self {
        let mut rng = StdRng::from_seed(seed);
        Self {
            id: rng.random(),
            name: name.to_owned(),
            reach_s,
            rng,
            current: None,
            candidate: None,
            retired: VecDeque::new(),
            pending: VecDeque::new(),
            base_s: 0.0,
            channel: 0,
            leaving: false,
            newest_s: 0.0,
            started: role.clone(),
            role,
            report_number: 0,
            report_ns: i64::MIN,
            stops: 0,
            stopped_by: VecDeque::new(),
            stats: FollowerStats::default(),
        }
    }

    /// The random number that identifies this follower.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// The present role, with all cues.
    pub fn role(&self) -> &Role {
        &self.role
    }

    /// Emergency stops of the stage so far.
    pub fn stops(&self) -> u64 {
        self.stops
    }

    /// Instance of the leader that is followed.
    pub fn leader(&self) -> Option<u64> {
        self.current.as_ref().map(|leader| leader.instance)
    }

    /// Whether no leader is alive.
    pub fn is_alone(&self, now_ns: i64) -> bool {
        self.current.as_ref().is_none_or(|leader| leader.is_lost(now_ns))
    }

    /// Whether the motion must be hidden: no leader is alive, or a change is due.
    pub fn is_leaving(&self, now_ns: i64) -> bool {
        self.leaving || self.is_alone(now_ns)
    }

    /// The motion time that is due, once known.
    pub fn due(&self, now_ns: i64) -> Option<PlayoutTime> {
        let leader = self.current.as_ref()?;
        let beats = f64::from(self.role.canon_beats.unwrap_or_default());
        let music_s = leader.music_s(now_ns)? - beats * leader.beat_s;
        Some(PlayoutTime {
            at_ns: now_ns,
            motion_s: music_s + self.base_s,
            rate: 1.0 + leader.clock.estimate()?.drift,
        })
    }

    /// The next frame to hand out. `shown_s`: motion time that the robot shows, if
    /// any; `hidden`: the motion is invisible.
    pub fn next_frame(
        &mut self,
        now_ns: i64,
        shown_s: Option<f64>,
        hidden: bool,
    ) -> Option<PlayoutFrame> {
        self.change_over(now_ns, hidden);
        let due_s = self.due(now_ns)?.motion_s;
        let from_s = match shown_s {
            Some(shown_s) if !hidden => shown_s,
            _ => due_s,
        };
        self.leaving |= !hidden && (from_s - due_s).abs() > FAR_S;
        if self.leaving {
            return None;
        }
        let base_s = self.base_s;
        let music_ns = |motion_s: f64| nanoseconds(motion_s - base_s);
        let reach_s = from_s + self.reach_s;
        let leader = self.current.as_mut()?;
        let lost = leader.buffer.lost;
        let frame = leader.buffer.pop(
            music_ns(from_s - RUN_UP_S),
            music_ns(reach_s + NOW_S),
            music_ns(reach_s + SOON_S),
        );
        self.stats.lost += leader.buffer.lost - lost;
        let frame = frame?;
        if frame.beat.tempo_bpm > 0.0 {
            leader.beat_s = 60.0 / f64::from(frame.beat.tempo_bpm.max(20.0));
        }
        let time_s = seconds(frame.music_ns) + base_s;
        self.newest_s = self.newest_s.max(time_s);
        Some(PlayoutFrame {
            motion: frame.motion(time_s),
            music: frame.music(time_s),
            posture: frame.posture,
        })
    }

    /// The time requests to send now.
    pub fn time_requests(&mut self, now_ns: i64) -> Vec<Vec<u8>> {
        let mut out = Vec::new();
        let leaders = [(&mut self.current, self.channel), (&mut self.candidate, 0)];
        for (leader, channel) in leaders {
            let Some(leader) = leader else { continue };
            let every_s = match leader.clock.exchanges() < SETTLED {
                true => REQUEST_SOON_S,
                false => REQUEST_S,
            };
            let resend = leader.needs_resend(now_ns);
            if now_ns < leader.request_ns && !resend {
                continue;
            }
            leader.request_ns = now_ns + nanoseconds(every_s);
            let request = TimeRequest {
                follower: self.id,
                instance: leader.instance,
                nonce: self.rng.random(),
                resend: resend.then_some(channel),
            };
            if self.pending.len() == PENDING {
                self.pending.pop_front();
            }
            let open = (request.nonce, request.instance, now_ns);
            self.pending.push_back(open);
            out.push(Message::TimeRequest(request).encode());
        }
        out
    }

    /// The report to the leader, when it is time for one.
    pub fn report(&mut self, now_ns: i64) -> Option<Vec<u8>> {
        if now_ns < self.report_ns {
            return None;
        }
        let instance = self.leader()?;
        self.report_ns = now_ns + nanoseconds(REPORT_S);
        self.report_number += 1;
        let stats = self.stats();
        let milliseconds = |s: f64| (s * 1e3).ceil().clamp(0.0, 60_000.0) as u16;
        let report = FollowerReport {
            follower: self.id,
            instance,
            number: self.report_number,
            needed_ms: milliseconds(stats.needed_s),
            transit_ms: milliseconds(stats.transit_s),
            lost: u32::try_from(stats.lost).unwrap_or(u32::MAX),
            name: self.name.clone(),
            style: self.role.style.clone().unwrap_or_default(),
        };
        Some(Message::FollowerReport(report).encode())
    }

    /// State and totals so far.
    pub fn stats(&self) -> FollowerStats {
        let mut stats = self.stats;
        if let Some(leader) = &self.current {
            stats.clock = leader.clock.estimate();
            stats.lead_s = leader.lead_s;
            stats.transit_s = leader.transits.max();
        }
        stats.needed_s = self.reach_s + HAND_OVER_S + RESERVE * stats.transit_s;
        stats
    }

    fn tracked(&mut self, instance: u64) -> Option<&mut TrackedLeader> {
        [&mut self.current, &mut self.candidate]
            .into_iter()
            .flatten()
            .find(|leader| leader.instance == instance)
    }

    /// Leaves a leader or channel, and joins another while the motion is hidden.
    fn change_over(&mut self, now_ns: i64, hidden: bool) {
        let alone = self.is_alone(now_ns);
        let ready = |leader: &TrackedLeader| leader.is_known(now_ns) && !leader.is_lost(now_ns);
        let taken_over = self.candidate.as_ref().is_some_and(ready);
        let wanted = self.wanted_channel();
        let other_channel = !alone && wanted != self.channel;
        let lost = alone && hidden;
        self.leaving |= self.current.is_some() && (lost || taken_over || other_channel);
        if !hidden {
            return;
        }
        if taken_over {
            self.follow_candidate(now_ns);
        } else if self.leaving && !alone {
            self.rejoin(wanted);
        }
    }

    /// The channel of the style of the role, if the leader sends that style.
    fn wanted_channel(&self) -> u8 {
        let known = |leader: &TrackedLeader| {
            let style = self.role.style.as_ref()?;
            leader.styles.get(style).copied()
        };
        self.current.as_ref().and_then(known).unwrap_or(0)
    }

    fn follow_candidate(&mut self, now_ns: i64) {
        let Some(leader) = self.candidate.take() else {
            return;
        };
        let music_s = leader.music_s(now_ns).unwrap_or_default();
        if let Some(last) = self.current.replace(leader) {
            if self.retired.len() == RETIRED {
                self.retired.pop_front();
            }
            self.retired.push_back(last.instance);
        }
        let begin_s = self.newest_s + BETWEEN_S - music_s;
        self.base_s = (begin_s * FRAME_RATE_HZ).ceil() / FRAME_RATE_HZ;
        self.channel = 0;
        // Cues outlive the leader that received them.
        self.started = self.role.clone();
        self.leaving = false;
        self.stats.joined += 1;
    }

    /// Rejoins the same leader on this channel.
    fn rejoin(&mut self, channel: u8) {
        if let Some(leader) = &mut self.current {
            match channel == self.channel {
                true => leader.buffer.restart(),
                false => leader.buffer.clear(),
            }
        }
        self.channel = channel;
        self.leaving = false;
        self.stats.left += 1;
        self.stats.joined += 1;
    }
}

#[cfg(test)]
mod tests;
