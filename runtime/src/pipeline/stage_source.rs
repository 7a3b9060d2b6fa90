//! The link between the control loop of a robot on a stage and its network
//! thread.
//!
//! ```text
//! network --frames--> ring -----------------> control loop
//!         --what is due, whether to idle--> latest-value slot --^
//!         <--what is shown, whether it is seen-- atomics --+
//! ```
//!
//! Neither waits for the other: frames are a queue, everything else is a latest
//! value.

// The network thread is built in with the feature `stage` alone.
#![cfg_attr(not(feature = "stage"), allow(dead_code))]

use super::dance_step::{DanceStep, Polled};
use servodance_stage::clock::PlaybackClock;
use servodance_stage::follower::{PlayoutFrame, PlayoutTime};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Frames that the ring holds; they come when it is nearly their turn.
const WAITING: usize = 128;

/// The monotonic clock of one program, nanoseconds; for tests it may be set
/// wrong and run fast.
#[derive(Clone, Copy, Debug)]
pub struct LocalClock {
    zero: Instant,
    offset_ns: i64,
    drift: f64,
}

impl LocalClock {
    /// A clock that reads `offset_s` now and is fast by `drift` seconds a second.
    pub fn start(offset_s: f64, drift: f64) -> Self {
        Self { zero: Instant::now(), offset_ns: (offset_s * 1e9) as i64, drift }
    }

    /// Its reading at a moment; it stands still before `start`.
    pub fn at(&self, moment: Instant) -> i64 {
        let since = moment.saturating_duration_since(self.zero).as_nanos() as i64;
        self.offset_ns + since + (since as f64 * self.drift) as i64
    }

    pub fn now_ns(&self) -> i64 {
        self.at(Instant::now())
    }

    /// How long it takes until it reads `time_ns`.
    pub fn until(&self, time_ns: i64) -> Duration {
        let left = time_ns.saturating_sub(self.now_ns()).max(0);
        Duration::from_nanos(left as u64)
    }
}

/// What the network thread knows of the leader.
#[derive(Clone, Copy, Debug, Default)]
pub struct LeaderNow {
    /// Which moment of the motion is due when; `None` while unknown.
    pub due: Option<PlayoutTime>,
    pub away: bool,
}

/// Which moment of the motion the robot shows, and whether it is visible.
#[derive(Debug, Default)]
struct Shown {
    motion_bits: AtomicU64,
    visible: AtomicBool,
}

pub struct StageSource {
    frames: rtrb::Consumer<PlayoutFrame>,
    leader: triple_buffer::Output<LeaderNow>,
    shown: Arc<Shown>,
    playback: PlaybackClock,
    clock: LocalClock,
}

pub struct StageSink {
    frames: rtrb::Producer<PlayoutFrame>,
    leader: triple_buffer::Input<LeaderNow>,
    shown: Arc<Shown>,
}

/// A link for a control loop of this period; due times are those of `clock`.
pub fn stage_link(period_s: f64, clock: LocalClock) -> (StageSource, StageSink) {
    let (producer, consumer) = rtrb::RingBuffer::new(WAITING);
    let (input, output) = triple_buffer::triple_buffer(&LeaderNow::default());
    let shown = Arc::new(Shown::default());
    let source = StageSource {
        frames: consumer,
        leader: output,
        shown: Arc::clone(&shown),
        playback: PlaybackClock::new(period_s),
        clock,
    };
    let sink = StageSink { frames: producer, leader: input, shown };
    (source, sink)
}

impl StageSource {
    pub(crate) fn poll(&mut self) -> Polled {
        match self.frames.pop() {
            Ok(PlayoutFrame { motion, music, posture }) => {
                Polled::Step(Box::new(DanceStep::received(music, motion, posture)))
            }
            Err(_) if self.leader.read().away => Polled::Away,
            Err(_) => Polled::Late,
        }
    }

    /// Whether a leader expects motion to be shown now.
    pub(crate) fn is_led(&mut self) -> bool {
        let leader = self.leader.read();
        leader.due.is_some() && !leader.away
    }

    /// Which moment of the motion to show at `moment`; `hidden`: idle covers it.
    pub(crate) fn moment_s(&mut self, moment: Instant, hidden: bool) -> f64 {
        let due = self.leader.read().due;
        let due_s = due.map(|due| due.at(self.clock.at(moment)));
        let shown_s = self.playback.next(due_s, hidden);
        let bits = shown_s.to_bits();
        self.shown.motion_bits.store(bits, Ordering::Relaxed);
        self.shown.visible.store(!hidden, Ordering::Relaxed);
        shown_s
    }
}

impl StageSink {
    /// Hands a frame over; `false` if there is no room.
    pub fn push(&mut self, frame: PlayoutFrame) -> bool {
        self.frames.push(frame).is_ok()
    }

    pub fn has_room(&self) -> bool {
        self.frames.slots() > 0
    }

    pub fn set_leader(&mut self, now: LeaderNow) {
        self.leader.write(now);
    }

    /// The moment of the motion that is shown, and whether it is hidden.
    pub fn shown(&self) -> (f64, bool) {
        let bits = self.shown.motion_bits.load(Ordering::Relaxed);
        (f64::from_bits(bits), !self.shown.visible.load(Ordering::Relaxed))
    }

    pub fn is_abandoned(&self) -> bool {
        self.frames.is_abandoned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_shown_follows_what_is_due_by_a_clock_that_is_wrong() {
        let clock = LocalClock::start(-500.0, 1e-3);
        let (mut source, mut sink) = stage_link(0.01, clock);
        let start = clock.zero;
        let due = PlayoutTime { at_ns: clock.at(start), motion_s: 7.0, rate: 1.0 / 1.001 };
        assert!(!source.is_led());
        sink.set_leader(LeaderNow { due: Some(due), away: false });
        assert!(source.is_led());
        for cycle in 0..200 {
            let moment = start + Duration::from_millis(10 * cycle);
            let shown_s = source.moment_s(moment, cycle < 2);
            assert!((shown_s - 7.0 - cycle as f64 * 0.01).abs() < 1e-5, "{shown_s}");
            assert_eq!(sink.shown(), (shown_s, cycle < 2));
        }
    }

    #[test]
    fn frames_keep_their_order_and_silence_says_why() {
        let (mut source, mut sink) = stage_link(0.01, LocalClock::start(0.0, 0.0));
        assert!(matches!(source.poll(), Polled::Late));
        let frame = |time_s: f64| PlayoutFrame {
            motion: servodance_types::MotionFrame {
                time_s,
                positions: Default::default(),
                contacts: Default::default(),
            },
            music: Default::default(),
            posture: Default::default(),
        };
        assert!((0..WAITING).all(|i| sink.push(frame(i as f64))));
        assert!(!sink.has_room() && !sink.push(frame(0.0)));
        sink.set_leader(LeaderNow { due: None, away: true });
        for i in 0..WAITING {
            let Polled::Step(step) = source.poll() else { panic!("a frame") };
            assert_eq!(step.motion.time_s, i as f64);
        }
        assert!(matches!(source.poll(), Polled::Away));
    }
}
