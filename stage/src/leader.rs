//! The leader's side: stamps frames, answers questions, keeps the roles, and
//! decides how long before their time frames are sent.
//!
//! The lead is what the neediest follower needs, between [`LEAST_S`] and
//! [`MOST_S`]: it grows at once and shrinks slowly. It only says how early frames
//! are sent; when they are shown does not depend on it, except where music comes
//! in live ([`Leader::lead_s`] is then what motion is late by).
//!
//! Nanoseconds of the leader's clock.

use crate::wire::{
    Answer, Frames, MOST_FRAMES, MOST_ROLES, Message, Question, Report, Role, Roles, StageFrame,
    WireError,
};
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use std::collections::{BTreeMap, VecDeque};

/// Frames in a message: the newest, and those that a lost message had.
const REDUNDANT: usize = 3;
/// Frames that are kept for who comes late: all that may not be over yet, of the
/// longest lead and a second.
const KEPT: usize = 80;
/// What was to be shown before this is not sent any more, seconds.
const OVER_S: f64 = 0.5;
/// The shortest and the longest lead, seconds.
const LEAST_S: f64 = 0.6;
const MOST_S: f64 = 3.0;
/// By how much it becomes shorter in a second.
const SHORTER_PER_S: f64 = 0.03;
/// A follower that was not heard for so long is gone, seconds.
const GONE_S: f64 = 5.0;
/// Followers that are kept track of.
const FOLLOWERS: usize = 256;
/// Cues that are remembered, so that each is heeded once.
const CUES: usize = 1024;

/// What came of a message that a leader got.
#[derive(Clone, Debug, PartialEq)]
pub enum Outgoing {
    /// Messages to a follower: an answer, then what it lacks.
    Tell(u64, Vec<Vec<u8>>),
    /// The roles changed: to everybody.
    Roles(Vec<u8>),
    /// Nothing to send.
    Nothing,
}

/// A follower as the leader knows it.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    /// Its name.
    pub name: String,
    /// How long before its time a frame must be sent, seconds.
    pub needed_s: f64,
    /// Longest way of a frame of late, seconds.
    pub way_s: f64,
    /// Frames that never came.
    pub lost: u32,
    /// The style that it would like; empty: any.
    pub style: String,
    number: u32,
    heard_ns: i64,
}

/// Leads one stage.
#[derive(Debug)]
pub struct Leader {
    instance: u64,
    term: u32,
    voices: BTreeMap<u8, Voice>,
    followers: BTreeMap<u64, Standing>,
    roles: BTreeMap<String, Role>,
    roles_number: u64,
    cues: VecDeque<u64>,
    lead_s: f64,
    lead_ns: i64,
    /// Messages that were not understood, not meant for a leader, or seen before.
    pub dropped: u64,
}

/// The last frames of one style.
#[derive(Debug, Default)]
struct Voice {
    /// Of the next frame.
    number: u64,
    style: String,
    recent: VecDeque<StageFrame>,
}

impl Leader {
    /// A leader of this term. `seed`: of its random numbers.
    pub fn new(term: u32, seed: [u8; 32]) -> Self {
        Self {
            instance: StdRng::from_seed(seed).random(),
            term,
            voices: BTreeMap::new(),
            followers: BTreeMap::new(),
            roles: BTreeMap::new(),
            roles_number: 0,
            cues: VecDeque::new(),
            lead_s: LEAST_S,
            lead_ns: i64::MIN,
            dropped: 0,
        }
    }

    /// The random number that tells it from others.
    pub fn instance(&self) -> u64 {
        self.instance
    }

    /// How many leaders took over before it.
    pub fn term(&self) -> u32 {
        self.term
    }

    /// The message with the next frame of a voice.
    pub fn frames(&mut self, now_ns: i64, voice: u8, style: &str, frame: StageFrame) -> Vec<u8> {
        let lead_ms = (self.lead_s * 1e3) as u16;
        let place = self.voices.entry(voice).or_default();
        if place.recent.len() == KEPT {
            place.recent.pop_front();
        }
        place.recent.push_back(frame);
        if place.style != style {
            style.clone_into(&mut place.style);
        }
        place.number += 1;
        let from = place.recent.len().saturating_sub(REDUNDANT);
        let message = Frames {
            instance: self.instance,
            term: self.term,
            number: place.number - 1,
            sent_ns: now_ns,
            lead_ms,
            voice,
            style: style.to_owned(),
            frames: place.recent.range(from..).copied().collect(),
        };
        Message::Frames(message).encode()
    }

    /// The frames of a voice that were sent and are not yet over.
    fn sent_already(&self, now_ns: i64, voice: u8) -> Vec<Vec<u8>> {
        let Some(place) = self.voices.get(&voice) else {
            return Vec::new();
        };
        let over_ns = now_ns - (OVER_S * 1e9) as i64;
        let first = place.number - place.recent.len() as u64;
        let numbered: Vec<(u64, StageFrame)> = (first..)
            .zip(place.recent.iter().copied())
            .filter(|(_, frame)| frame.present_ns >= over_ns)
            .collect();
        let message = |part: &[(u64, StageFrame)]| {
            let message = Frames {
                instance: self.instance,
                term: self.term,
                number: part.last().map_or(0, |(number, _)| *number),
                sent_ns: now_ns,
                lead_ms: (self.lead_s * 1e3) as u16,
                voice,
                style: place.style.clone(),
                frames: part.iter().map(|(_, frame)| *frame).collect(),
            };
            Message::Frames(message).encode()
        };
        numbered.chunks(MOST_FRAMES).map(message).collect()
    }

    /// Takes in a message that came at `heard_ns`; an answer is stamped by `now`.
    ///
    /// # Errors
    /// What is wrong with it; it was counted and dropped.
    pub fn hear(
        &mut self,
        heard_ns: i64,
        bytes: &[u8],
        now: impl FnOnce() -> i64,
    ) -> Result<Outgoing, WireError> {
        match Message::decode(bytes) {
            Ok(Message::Question(question)) => Ok(self.answer(heard_ns, question, now)),
            Ok(Message::Report(report)) => {
                self.note(heard_ns, report);
                Ok(Outgoing::Nothing)
            }
            Ok(Message::Cue(cue)) => {
                if self.cues.contains(&cue.nonce) {
                    self.dropped += 1;
                    return Ok(Outgoing::Nothing);
                }
                if self.cues.len() == CUES {
                    self.cues.pop_front();
                }
                self.cues.push_back(cue.nonce);
                let known = self.roles.contains_key(&cue.follower);
                if cue.follower.is_empty() || !known && self.roles.len() == MOST_ROLES {
                    self.dropped += 1;
                    return Ok(Outgoing::Nothing);
                }
                if cue.follower == "all" {
                    self.roles
                        .values_mut()
                        .for_each(|role| role.take(&cue.role));
                }
                self.roles.entry(cue.follower).or_default().take(&cue.role);
                Ok(Outgoing::Roles(self.roles()))
            }
            Ok(_) => {
                self.dropped += 1;
                Ok(Outgoing::Nothing)
            }
            Err(error) => {
                self.dropped += 1;
                Err(error)
            }
        }
    }

    /// The message with all roles; to be sent again now and then.
    pub fn roles(&mut self) -> Vec<u8> {
        self.roles_number += 1;
        let mut roles: Vec<(String, Role)> = Vec::new();
        // First what is for all, so that a follower's own role comes after it.
        for all in [true, false] {
            let these = self
                .roles
                .iter()
                .filter(|(name, _)| (*name == "all") == all);
            roles.extend(these.map(|(name, role)| (name.clone(), role.clone())));
        }
        let message = Roles {
            instance: self.instance,
            term: self.term,
            number: self.roles_number,
            roles,
        };
        Message::Roles(message).encode()
    }

    /// How long before their time frames are sent now, seconds.
    pub fn lead_s(&mut self, now_ns: i64) -> f64 {
        self.forget(now_ns);
        let needs = self.followers.values().map(|f| f.needed_s);
        let wanted_s = needs.fold(LEAST_S, f64::max).min(MOST_S);
        let since_ns = match self.lead_ns {
            i64::MIN => 0,
            last_ns => now_ns - last_ns,
        };
        self.lead_ns = now_ns;
        let least_s = self.lead_s - SHORTER_PER_S * since_ns as f64 * 1e-9;
        self.lead_s = wanted_s.max(least_s);
        self.lead_s
    }

    /// The followers that were heard of late.
    pub fn followers(&self) -> impl Iterator<Item = &Standing> {
        self.followers.values()
    }

    fn answer(&mut self, heard_ns: i64, question: Question, now: impl FnOnce() -> i64) -> Outgoing {
        if question.instance != self.instance {
            self.dropped += 1;
            return Outgoing::Nothing;
        }
        let answer = Answer {
            instance: self.instance,
            nonce: question.nonce,
            heard_ns,
            answered_ns: now(),
        };
        let mut messages = vec![Message::Answer(answer).encode()];
        if let Some(voice) = question.lacks {
            messages.extend(self.sent_already(heard_ns, voice));
        }
        Outgoing::Tell(question.follower, messages)
    }

    fn note(&mut self, now_ns: i64, report: Report) {
        self.forget(now_ns);
        let known = self.followers.get(&report.follower);
        let old = known.is_some_and(|known| report.number <= known.number);
        let full = known.is_none() && self.followers.len() == FOLLOWERS;
        if report.instance != self.instance || old || full {
            self.dropped += 1;
            return;
        }
        let standing = Standing {
            name: report.name,
            needed_s: f64::from(report.needed_ms) * 1e-3,
            way_s: f64::from(report.way_ms) * 1e-3,
            lost: report.lost,
            style: report.style,
            number: report.number,
            heard_ns: now_ns,
        };
        self.followers.insert(report.follower, standing);
    }

    fn forget(&mut self, now_ns: i64) {
        let gone_ns = (GONE_S * 1e9) as i64;
        self.followers
            .retain(|_, f| now_ns.saturating_sub(f.heard_ns) < gone_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::Cue;

    const SECOND: i64 = 1_000_000_000;

    fn report(leader: &Leader, follower: u64, number: u32, needed_ms: u16) -> Vec<u8> {
        let report = Report {
            follower,
            instance: leader.instance(),
            number,
            needed_ms,
            way_ms: 0,
            lost: 0,
            name: "neck".into(),
            style: String::new(),
        };
        Message::Report(report).encode()
    }

    #[test]
    fn the_lead_is_that_of_the_neediest_and_shrinks_slowly() {
        let mut leader = Leader::new(0, [1; 32]);
        assert_eq!(leader.lead_s(0), LEAST_S);
        for (follower, needed_ms) in [(1, 700), (2, 1200)] {
            let bytes = report(&leader, follower, 1, needed_ms);
            leader.hear(0, &bytes, || 0).unwrap();
        }
        assert_eq!(leader.lead_s(SECOND), 1.2);
        let bytes = report(&leader, 2, 2, 60_000);
        leader.hear(SECOND, &bytes, || 0).unwrap();
        assert_eq!(leader.lead_s(2 * SECOND), MOST_S);
        leader.hear(3 * SECOND, &bytes, || 0).unwrap();
        assert_eq!(leader.dropped, 1, "a report that was seen before");
        let later = leader.lead_s(22 * SECOND);
        assert!(
            (later - (MOST_S - 20.0 * SHORTER_PER_S)).abs() < 1e-9,
            "{later}"
        );
        assert_eq!(leader.followers().count(), 0, "gone");
    }

    #[test]
    fn a_cue_is_heeded_once_and_a_role_of_ones_own_goes_before_that_of_all() {
        let mut leader = Leader::new(0, [1; 32]);
        let mut cue = |nonce, follower: &str, amplitude| {
            let role = Role {
                amplitude: Some(amplitude),
                ..Role::default()
            };
            let follower = follower.to_owned();
            let bytes = Message::Cue(Cue {
                nonce,
                follower,
                role,
            })
            .encode();
            leader.hear(0, &bytes, || 0).unwrap()
        };
        assert!(matches!(cue(1, "neck", 0.5), Outgoing::Roles(_)));
        assert_eq!(cue(1, "neck", 0.5), Outgoing::Nothing);
        let Outgoing::Roles(bytes) = cue(2, "all", 0.2) else {
            panic!("roles")
        };
        let Ok(Message::Roles(roles)) = Message::decode(&bytes) else {
            panic!("roles")
        };
        let amplitudes = roles.roles.iter().map(|(n, r)| (n.as_str(), r.amplitude));
        let wanted = [("all", Some(0.2)), ("neck", Some(0.2))];
        assert_eq!(amplitudes.collect::<Vec<_>>(), wanted);
    }

    fn frame(n: i64) -> StageFrame {
        StageFrame {
            present_ns: n,
            music_ns: n,
            beat: Default::default(),
            presence: 0.0,
            level: 0.0,
            contacts: Default::default(),
            positions: Default::default(),
            posture: Default::default(),
        }
    }

    #[test]
    fn who_comes_late_gets_what_was_sent_and_is_not_over() {
        let mut leader = Leader::new(0, [1; 32]);
        for n in 0..100 {
            leader.frames(0, 0, "hype", frame(n * SECOND / 20));
        }
        let question = Question {
            follower: 7,
            instance: leader.instance(),
            nonce: 1,
            lacks: Some(0),
        };
        let bytes = Message::Question(question).encode();
        let told = leader.hear(3 * SECOND, &bytes, || 0).unwrap();
        let Outgoing::Tell(7, messages) = told else {
            panic!("an answer")
        };
        let numbers = messages[1..].iter().flat_map(|bytes| {
            let Ok(Message::Frames(frames)) = Message::decode(bytes) else {
                panic!("frames")
            };
            let numbers: Vec<u64> = frames.numbered().map(|(number, _)| number).collect();
            numbers
        });
        assert_eq!(numbers.collect::<Vec<_>>(), (50..100).collect::<Vec<_>>());
        let bytes = Message::Question(Question {
            lacks: None,
            ..question
        })
        .encode();
        let told = leader.hear(3 * SECOND, &bytes, || 0).unwrap();
        assert!(matches!(told, Outgoing::Tell(7, messages) if messages.len() == 1));
    }

    #[test]
    fn every_message_carries_the_frames_before_it() {
        let mut leader = Leader::new(0, [1; 32]);
        let sent: Vec<Vec<u64>> = (0..5)
            .map(|n| {
                let bytes = leader.frames(n, 0, "hype", frame(n));
                let Ok(Message::Frames(frames)) = Message::decode(&bytes) else {
                    panic!("frames")
                };
                frames.numbered().map(|(number, _)| number).collect()
            })
            .collect();
        assert_eq!(sent[0], [0]);
        assert_eq!(sent[4], [2, 3, 4]);
    }
}
