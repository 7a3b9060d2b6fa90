//! A follower: whom to follow, what time it is there, which frame is next.
//!
//! ```text
//!            frames, answers                 heard no more, other voice, far off
//!   Alone -------------------> Following -----------------------------> Leaving
//!     ^                                                                    |
//!     +--------- nothing of the motion is seen any more (hidden) ----------+
//! ```
//!
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

use crate::clock::{Estimate, StageClock};
use crate::lateness::Worst;
use crate::playout::Playout;
use crate::wire::{Frames, Message, Question, Report, Role, Roles, WireError};
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use servodance_types::{FRAME_RATE_HZ, MotionFrame, MusicFrame};
use std::collections::{BTreeMap, VecDeque};

/// Silence after which a leader counts as lost: at least, at most, and in
/// between so many of the longest pauses of late. Seconds.
const PATIENCE_S: [f64; 2] = [0.45, 0.9];
const PAUSES: f64 = 1.5;
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
/// Share by which the longest way of late may be exceeded.
const RESERVE: f64 = 1.25;
/// Motion begins this much before what is due, seconds.
const RUN_UP_S: f64 = 0.3;
/// Between the motion of one leader and of the next, seconds: more than a
/// retargeter bridges.
const BETWEEN_S: f64 = 2.0;
/// Farther off than this, motion is left and taken up anew, seconds.
const FAR_S: f64 = 3.0;
/// A frame is not meant for a moment farther from its sending, seconds.
const FARTHEST_S: f64 = 20.0;
/// Questions that may be out, leaders that are remembered, voices.
const PENDING: usize = 64;
const RETIRED: usize = 16;
const VOICES: usize = 8;
/// Length of a beat while no tempo is known, seconds.
const USUAL_BEAT_S: f64 = 0.5;

/// What was dropped, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// No message of a stage, or one that is damaged.
    pub malformed: u64,
    /// Longer than any message is.
    pub huge: u64,
    /// Of another version of the format.
    pub other_version: u64,
    /// Seen before, or of a leader that was left.
    pub replayed: u64,
    /// Of a leader that is not followed while another is.
    pub rivals: u64,
    /// Answers to nothing that was asked.
    pub unasked: u64,
    /// Good, but not for a follower, or not believable.
    pub misplaced: u64,
}

impl Counters {
    /// All of them.
    pub fn total(&self) -> u64 {
        let Self {
            malformed,
            huge,
            other_version,
            replayed,
            rivals,
            unasked,
            misplaced,
        } = self;
        malformed + huge + other_version + replayed + rivals + unasked + misplaced
    }
}

/// A frame whose turn it is, in motion time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Released {
    /// The motion.
    pub motion: MotionFrame,
    /// The music that it was made for.
    pub music: MusicFrame,
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

/// How it goes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// The leader's clock; `None` while it is not known.
    pub clock: Option<Estimate>,
    /// How long before its time a frame must be sent, seconds.
    pub needed_s: f64,
    /// How long before its time the leader sends, seconds.
    pub lead_s: f64,
    /// Longest way of a frame of late, seconds.
    pub way_s: f64,
    /// Frames that never came.
    pub lost: u64,
    /// How often a leader was followed.
    pub joined: u64,
    /// How often one was lost or left.
    pub left: u64,
    /// What was dropped.
    pub dropped: Counters,
}

/// A leader as its follower knows it.
#[derive(Debug)]
struct Led {
    instance: u64,
    term: u32,
    clock: StageClock,
    /// When it was heard last, and how long it paused of late.
    heard_ns: i64,
    pauses: Worst,
    ways: Worst,
    /// The token of the leader went away.
    gone: bool,
    /// Newest number of each voice.
    newest: BTreeMap<u8, u64>,
    /// Voices by the style they dance.
    styles: BTreeMap<String, u8>,
    playout: Playout,
    /// Leader's clock less music time, nanoseconds, by the newest frame.
    music_start_ns: i64,
    lead_s: f64,
    beat_s: f64,
    roles_number: u64,
    ask_ns: i64,
}

impl Led {
    fn new(instance: u64, term: u32, now_ns: i64) -> Self {
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
        }
    }

    fn lives(&mut self, now_ns: i64) {
        self.pauses
            .note(now_ns, seconds(now_ns - self.heard_ns).max(0.0));
        self.heard_ns = self.heard_ns.max(now_ns);
        self.gone = false;
    }

    fn is_lost(&self, now_ns: i64) -> bool {
        let patience_s = (PAUSES * self.pauses.of_late()).clamp(PATIENCE_S[0], PATIENCE_S[1]);
        self.gone || seconds(now_ns - self.heard_ns) > patience_s
    }

    /// Seconds of its music at a moment, if its clock and music are known.
    fn music_s(&self, now_ns: i64) -> Option<f64> {
        let estimate = self.clock.estimate()?;
        let known = !self.newest.is_empty();
        known.then(|| seconds(estimate.leader_ns(now_ns) - self.music_start_ns))
    }

    fn is_known(&self, now_ns: i64) -> bool {
        self.music_s(now_ns).is_some()
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

    /// Takes in a message that came at `now_ns`.
    ///
    /// # Errors
    /// What is wrong with it; it was counted and dropped.
    pub fn hear(&mut self, now_ns: i64, bytes: &[u8]) -> Result<(), WireError> {
        let message = Message::decode(bytes);
        let dropped = &mut self.figures.dropped;
        match &message {
            Err(WireError::Huge(_)) => dropped.huge += 1,
            Err(WireError::Version(_)) => dropped.other_version += 1,
            Err(_) => dropped.malformed += 1,
            Ok(Message::Frames(frames)) => self.hear_frames(now_ns, frames),
            Ok(Message::Answer(answer)) => {
                let asked = |(nonce, instance, _): &(u64, u64, i64)| {
                    (*nonce, *instance) == (answer.nonce, answer.instance)
                };
                let place = self.pending.iter().position(asked);
                let Some((_, instance, asked_ns)) = place.and_then(|i| self.pending.remove(i))
                else {
                    dropped.unasked += 1;
                    return Ok(());
                };
                if let Some(led) = self.led(instance) {
                    led.clock
                        .push(asked_ns, answer.heard_ns, answer.answered_ns, now_ns);
                    led.lives(now_ns);
                }
            }
            Ok(Message::Roles(roles)) => self.hear_roles(now_ns, roles),
            Ok(_) => dropped.misplaced += 1,
        }
        message.map(drop)
    }

    /// The liveliness token of a leader went away.
    pub fn leader_gone(&mut self, instance: u64) {
        if let Some(led) = self.led(instance) {
            led.gone = true;
        }
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
        if self.is_leaving(now_ns) {
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
        })
    }

    /// The questions to ask now.
    pub fn questions(&mut self, now_ns: i64) -> Vec<Vec<u8>> {
        let mut out = Vec::new();
        for led in [&mut self.current, &mut self.candidate]
            .into_iter()
            .flatten()
        {
            let every_s = match led.clock.exchanges() < SETTLED {
                true => ASK_SOON_S,
                false => ASK_S,
            };
            if now_ns < led.ask_ns {
                continue;
            }
            led.ask_ns = now_ns + nanoseconds(every_s);
            let question = Question {
                follower: self.id,
                instance: led.instance,
                nonce: self.rng.random(),
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

    fn hear_frames(&mut self, now_ns: i64, frames: &Frames) {
        if self.retired.contains(&frames.instance) {
            self.figures.dropped.replayed += 1;
            return;
        }
        let sent_ns = frames.sent_ns;
        let believable = |frame: &crate::wire::StageFrame| {
            seconds(frame.present_ns - sent_ns).abs() < FARTHEST_S
        };
        if !frames.frames.iter().all(believable) {
            self.figures.dropped.misplaced += 1;
            return;
        }
        if self.led(frames.instance).is_none() && !self.court(now_ns, frames) {
            self.figures.dropped.rivals += 1;
            return;
        }
        let (current, voice) = (self.leader(), self.voice);
        let Some(led) = self.led(frames.instance) else {
            return;
        };
        let newest = led.newest.get(&frames.voice).copied();
        if newest.is_some_and(|newest| frames.number <= newest) {
            self.figures.dropped.replayed += 1;
            return;
        }
        if newest.is_none() && led.newest.len() == VOICES {
            self.figures.dropped.misplaced += 1;
            return;
        }
        led.newest.insert(frames.voice, frames.number);
        led.lives(now_ns);
        led.lead_s = f64::from(frames.lead_ms) * 1e-3;
        if led.styles.len() < VOICES || led.styles.contains_key(&frames.style) {
            led.styles.insert(frames.style.clone(), frames.voice);
        }
        if let Some(newest) = frames.frames.last() {
            led.music_start_ns = newest.present_ns - newest.music_ns;
        }
        if let Some(estimate) = led.clock.estimate() {
            let way_s = seconds(estimate.leader_ns(now_ns) - sent_ns);
            led.ways.note(now_ns, way_s.clamp(0.0, FARTHEST_S));
        }
        let wanted = match current == Some(frames.instance) {
            true => voice,
            false => 0,
        };
        if frames.voice == wanted {
            for (number, frame) in frames.numbered() {
                led.playout.push(number, frame);
            }
        }
    }

    /// Whether a leader that is new may be looked at.
    fn court(&mut self, now_ns: i64, frames: &Frames) -> bool {
        let beats = |led: &Led| led.is_lost(now_ns) || frames.term > led.term;
        let better =
            self.current.as_ref().is_none_or(beats) && self.candidate.as_ref().is_none_or(beats);
        if better {
            self.candidate = Some(Led::new(frames.instance, frames.term, now_ns));
        }
        better
    }

    fn hear_roles(&mut self, now_ns: i64, roles: &Roles) {
        let (name, started) = (self.name.clone(), self.started.clone());
        let current = self.current.as_mut();
        let Some(led) = current.filter(|led| led.instance == roles.instance) else {
            self.figures.dropped.rivals += 1;
            return;
        };
        if roles.number <= led.roles_number {
            self.figures.dropped.replayed += 1;
            return;
        }
        led.roles_number = roles.number;
        led.lives(now_ns);
        let mut role = started;
        let for_me = |(whom, _): &&(String, Role)| *whom == name || whom == "all";
        for (_, change) in roles.roles.iter().filter(for_me) {
            role.take(change);
        }
        self.role = role;
    }

    /// Leaves, and follows anew, what and when it may.
    fn change_over(&mut self, now_ns: i64, hidden: bool) {
        let alone = self.is_alone(now_ns);
        let ready = |led: &Led| led.is_known(now_ns) && !led.is_lost(now_ns);
        let taken_over = self.candidate.as_ref().is_some_and(ready);
        let wanted = self.wanted_voice();
        let other_voice = !alone && wanted != self.voice;
        self.leaving |= self.current.is_some() && (alone || taken_over || other_voice);
        if !hidden {
            return;
        }
        if taken_over {
            self.follow_candidate(now_ns);
        } else if self.leaving && !alone {
            self.voice = wanted;
            self.begin();
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
        self.role = self.started.clone();
        self.leaving = false;
        self.figures.joined += 1;
    }

    /// Takes the motion of the same leader up anew.
    fn begin(&mut self) {
        if let Some(led) = &mut self.current {
            led.playout.clear();
        }
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
