//! A follower: whom to follow, what time it is there, which frame is next.
//!
//! ```text
//!            frames, answers               other leader or voice, far off
//!   Alone -------------------> Following -----------------------------> Leaving
//!     ^                         |  ^                                       |
//!     |       heard no more: v  |  |  heard again                          |
//!     +------ out of sight --- Fading                                      |
//!     +--------- nothing of the motion is seen any more (hidden) ----------+
//! ```
//!
//! - While it fades it dances what it was sent before, so that a silence that
//!   ends in time leaves but a dip in the movement.
//! - One leader is followed at a time. Another one is heeded when that one is
//!   not heard any more, or when its term is higher (it took over); and only
//!   once it has answered questions with their nonces, which a recording of an
//!   old leader cannot.
//! - A leader that was left for another is never followed again; messages whose
//!   number is not higher than the last are dropped.
//! - Motion begins, ends and changes over only while it is not seen: the robot
//!   idles then, so nothing jumps.
//!
//! Times are nanoseconds of the follower's clock. *Motion time* is what frames
//! are handed over in: seconds on the 20 Hz grid, growing from one leader to the
//! next.

mod figures;
mod hearing;
mod led;

pub use figures::{Counters, Figures};

use crate::wire::{Message, Question, Report, Role};
use led::Led;
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use servodance_types::{FRAME_RATE_HZ, MotionFrame, MusicFrame, Posture};
use std::collections::VecDeque;

/// Questions come so often at first, and later. Seconds.
const ASK_SOON_S: f64 = 0.06;
const ASK_S: f64 = 0.25;
/// Exchanges until it is later.
const SETTLED: usize = 12;
/// Reports come so often, seconds.
const REPORT_S: f64 = 0.5;
/// Frames are handed over this much before they are needed, seconds.
const SOON_S: f64 = 0.25;
/// Frames before which others are missing: this much.
const NOW_S: f64 = 0.06;
/// What handing over may take beside it, seconds.
const HAND_OVER_S: f64 = 0.1;
/// By how much the longest way of late may be exceeded: what is lost twice takes
/// TCP three times as long.
const RESERVE: f64 = 2.5;
/// Motion begins this much before what is due, seconds.
const RUN_UP_S: f64 = 0.3;
/// Between the motion of one leader and of the next, seconds: more than a
/// retargeter bridges.
const BETWEEN_S: f64 = 2.0;
/// Farther off than this, motion is left and taken up anew, seconds.
const FAR_S: f64 = 3.0;
/// Questions that may be out, leaders that are remembered.
const PENDING: usize = 64;
const RETIRED: usize = 16;
/// A frame whose turn it is, in motion time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Released {
    /// The motion.
    pub motion: MotionFrame,
    /// The music that it was made for.
    pub music: MusicFrame,
    /// What is usual for the dancer.
    pub posture: Posture,
}

/// Which moment of the motion the servos shall show when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Due {
    /// A moment, nanoseconds of the follower's clock.
    pub at_ns: i64,
    /// What is due then, seconds of motion.
    pub motion_s: f64,
    /// Seconds of motion a second of the follower's clock.
    pub rate: f64,
}

impl Due {
    /// What is due at a moment of the follower's clock, seconds of motion.
    pub fn at(&self, now_ns: i64) -> f64 {
        self.motion_s + self.rate * seconds(now_ns.saturating_sub(self.at_ns))
    }
}

/// One robot's place on the stage.
#[derive(Debug)]
pub struct Follower {
    id: u64,
    name: String,
    /// From what is due to what the retargeter must know, seconds.
    reach_s: f64,
    rng: StdRng,
    current: Option<Led>,
    candidate: Option<Led>,
    retired: VecDeque<u64>,
    /// Questions that are out: nonce, instance, when.
    pending: VecDeque<(u64, u64, i64)>,
    /// Motion time less music time of the current leader, seconds.
    base_s: f64,
    voice: u8,
    /// The motion is on its way out of sight.
    leaving: bool,
    /// Motion time of the newest frame that was handed over.
    newest_s: f64,
    /// How it dances where the leader knows of no cue.
    started: Role,
    role: Role,
    report_number: u32,
    report_ns: i64,
    figures: Figures,
}

impl Follower {
    /// A follower that dances as `role` says unless it is told otherwise. The
    /// retargeter must know motion `reach_s` beyond what is due at the servos.
    /// `seed`: of its random numbers, which nobody else should know.
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
            voice: 0,
            leaving: false,
            newest_s: 0.0,
            started: role.clone(),
            role,
            report_number: 0,
            report_ns: i64::MIN,
            figures: Figures::default(),
        }
    }

    /// The number by which it is addressed.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// How it shall dance now.
    pub fn role(&self) -> &Role {
        &self.role
    }

    /// The leader that is followed.
    pub fn leader(&self) -> Option<u64> {
        self.current.as_ref().map(|led| led.instance)
    }

    /// Whether there is no leader to be heard.
    pub fn is_alone(&self, now_ns: i64) -> bool {
        self.current.as_ref().is_none_or(|led| led.is_lost(now_ns))
    }

    /// Whether the motion must go out of sight: nobody leads, or it leads
    /// elsewhere.
    pub fn is_leaving(&self, now_ns: i64) -> bool {
        self.leaving || self.is_alone(now_ns)
    }

    /// What is due, once that is known.
    pub fn due(&self, now_ns: i64) -> Option<Due> {
        let led = self.current.as_ref()?;
        let beats = f64::from(self.role.canon_beats.unwrap_or_default());
        let music_s = led.music_s(now_ns)? - beats * led.beat_s;
        Some(Due {
            at_ns: now_ns,
            motion_s: music_s + self.base_s,
            rate: 1.0 + led.clock.estimate()?.drift,
        })
    }

    /// The next frame that shall be handed over. `shown_s` is the moment of
    /// motion that the robot shows, if it shows any; `hidden`: it is not seen.
    pub fn next_frame(
        &mut self,
        now_ns: i64,
        shown_s: Option<f64>,
        hidden: bool,
    ) -> Option<Released> {
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
        let led = self.current.as_mut()?;
        let lost = led.playout.lost;
        let frame = led.playout.pop(
            music_ns(from_s - RUN_UP_S),
            music_ns(reach_s + NOW_S),
            music_ns(reach_s + SOON_S),
        );
        self.figures.lost += led.playout.lost - lost;
        let frame = frame?;
        if frame.beat.tempo_bpm > 0.0 {
            led.beat_s = 60.0 / f64::from(frame.beat.tempo_bpm.max(20.0));
        }
        let time_s = seconds(frame.music_ns) + base_s;
        self.newest_s = self.newest_s.max(time_s);
        Some(Released {
            motion: frame.motion(time_s),
            music: frame.music(time_s),
            posture: frame.posture,
        })
    }

    /// The questions to ask now.
    pub fn questions(&mut self, now_ns: i64) -> Vec<Vec<u8>> {
        let mut out = Vec::new();
        let voices = [self.voice, 0];
        let leds = [&mut self.current, &mut self.candidate];
        for (led, voice) in leds.into_iter().zip(voices) {
            let Some(led) = led else { continue };
            let every_s = match led.clock.exchanges() < SETTLED {
                true => ASK_SOON_S,
                false => ASK_S,
            };
            let lacks = led.lacks(now_ns);
            if now_ns < led.ask_ns && !lacks {
                continue;
            }
            led.ask_ns = now_ns + nanoseconds(every_s);
            let question = Question {
                follower: self.id,
                instance: led.instance,
                nonce: self.rng.random(),
                lacks: lacks.then_some(voice),
            };
            if self.pending.len() == PENDING {
                self.pending.pop_front();
            }
            self.pending
                .push_back((question.nonce, question.instance, now_ns));
            out.push(Message::Question(question).encode());
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
        let figures = self.figures();
        let milliseconds = |s: f64| (s * 1e3).ceil().clamp(0.0, 60_000.0) as u16;
        let report = Report {
            follower: self.id,
            instance,
            number: self.report_number,
            needed_ms: milliseconds(figures.needed_s),
            way_ms: milliseconds(figures.way_s),
            lost: u32::try_from(figures.lost).unwrap_or(u32::MAX),
            name: self.name.clone(),
            style: self.role.style.clone().unwrap_or_default(),
        };
        Some(Message::Report(report).encode())
    }

    /// How it goes.
    pub fn figures(&self) -> Figures {
        let mut figures = self.figures;
        if let Some(led) = &self.current {
            figures.clock = led.clock.estimate();
            figures.lead_s = led.lead_s;
            figures.way_s = led.ways.of_late();
        }
        figures.needed_s = self.reach_s + HAND_OVER_S + RESERVE * figures.way_s;
        figures
    }

    fn led(&mut self, instance: u64) -> Option<&mut Led> {
        [&mut self.current, &mut self.candidate]
            .into_iter()
            .flatten()
            .find(|led| led.instance == instance)
    }

    /// Leaves, and follows anew, what and when it may.
    fn change_over(&mut self, now_ns: i64, hidden: bool) {
        let alone = self.is_alone(now_ns);
        let ready = |led: &Led| led.is_known(now_ns) && !led.is_lost(now_ns);
        let taken_over = self.candidate.as_ref().is_some_and(ready);
        let wanted = self.wanted_voice();
        let other_voice = !alone && wanted != self.voice;
        let lost = alone && hidden;
        self.leaving |= self.current.is_some() && (lost || taken_over || other_voice);
        if !hidden {
            return;
        }
        if taken_over {
            self.follow_candidate(now_ns);
        } else if self.leaving && !alone {
            self.begin(wanted);
        }
    }

    /// The voice of the style that is wanted, if somebody dances it.
    fn wanted_voice(&self) -> u8 {
        let known = |led: &Led| {
            let style = self.role.style.as_ref()?;
            let voice = *led.styles.get(style)?;
            Some(voice)
        };
        self.current.as_ref().and_then(known).unwrap_or(0)
    }

    fn follow_candidate(&mut self, now_ns: i64) {
        let Some(led) = self.candidate.take() else {
            return;
        };
        let music_s = led.music_s(now_ns).unwrap_or_default();
        if let Some(last) = self.current.replace(led) {
            if self.retired.len() == RETIRED {
                self.retired.pop_front();
            }
            self.retired.push_back(last.instance);
        }
        let begin_s = self.newest_s + BETWEEN_S - music_s;
        self.base_s = (begin_s * FRAME_RATE_HZ).ceil() / FRAME_RATE_HZ;
        self.voice = 0;
        // Cues outlive the leader that they were given to.
        self.started = self.role.clone();
        self.leaving = false;
        self.figures.joined += 1;
    }

    /// Takes the motion of the same leader up anew, in this voice.
    fn begin(&mut self, voice: u8) {
        if let Some(led) = &mut self.current {
            match voice == self.voice {
                true => led.playout.begin(),
                false => led.playout.clear(),
            }
        }
        self.voice = voice;
        self.leaving = false;
        self.figures.left += 1;
        self.figures.joined += 1;
    }
}

fn seconds(nanoseconds: i64) -> f64 {
    nanoseconds as f64 * 1e-9
}

fn nanoseconds(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

#[cfg(test)]
mod tests;
