//! The leader: stamps frames, replies to time requests, keeps the roles, and decides
//! how long before their presentation time frames are sent (the lead).
//!
//! The lead is the largest need of all followers, between `LEAST_S` and
//! `MOST_S`: it grows at once and shrinks slowly. The presentation time does not
//! depend on it, except with live music, where motion is late by
//! [`Leader::lead_s`].
//!
//! Times are nanoseconds of the leader's clock.

use crate::messages::{
    Cue, CueReply, FollowerReport, Frames, MAX_FRAMES, MAX_ROLES, Message, MessageError, Role,
    Roles, StageFrame, StageStop, TimeReply, TimeRequest,
};
use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use std::collections::{BTreeMap, VecDeque};

/// Frames in a message: the newest, and those of lost messages.
const REDUNDANT: usize = 3;
/// Frames kept for followers that join late: those of the longest lead and a second.
const KEPT: usize = 80;
/// Frames whose time passed longer ago are not sent again, seconds.
const OVER_S: f64 = 0.5;
/// The shortest and the longest lead, seconds.
const LEAST_S: f64 = 0.6;
const MOST_S: f64 = 3.0;
/// Decrease of the lead in a second, seconds.
const SHORTER_PER_S: f64 = 0.03;
/// Silence after which a follower is gone, seconds.
const GONE_S: f64 = 5.0;
/// Largest number of followers.
const FOLLOWERS: usize = 256;
/// Cues whose nonce is remembered, so that each is obeyed once.
const CUES: usize = 1024;

/// Result of a message that the leader received.
#[derive(Clone, Debug, PartialEq)]
pub enum Outgoing {
    /// Messages to one follower: a time reply, then the frames to resend.
    Reply(u64, Vec<Vec<u8>>),
    /// A cue was taken.
    Cued {
        /// The nonce of the cue: the sender listens at its key.
        nonce: u64,
        /// The message to the sender.
        reply: Vec<u8>,
        /// The message to all followers: their roles.
        roles: Vec<u8>,
    },
    /// The message needs no reply.
    Nothing,
}

/// State of a follower, by its reports.
#[derive(Clone, Debug, PartialEq)]
pub struct FollowerStatus {
    /// The random number that identifies the follower.
    pub id: u64,
    /// Name of the follower.
    pub name: String,
    /// How long before its time a frame must be sent, seconds.
    pub needed_s: f64,
    /// Longest recent transit of a frame, seconds.
    pub transit_s: f64,
    /// Number of frames that never arrived.
    pub lost: u32,
    /// The style that the follower prefers; empty: any.
    pub style: String,
    number: u32,
    heard_ns: i64,
}

/// The leader of one stage.
#[derive(Debug)]
pub struct Leader {
    instance: u64,
    term: u32,
    channels: BTreeMap<u8, Channel>,
    followers: BTreeMap<u64, FollowerStatus>,
    roles: BTreeMap<String, Role>,
    roles_number: u64,
    stops: u64,
    cues: VecDeque<u64>,
    lead_s: f64,
    lead_ns: i64,
    /// Number of messages that were malformed, not for a leader, or seen before.
    pub dropped: u64,
}

#[derive(Debug, Default)]
struct Channel {
    number: u64,
    style: String,
    recent: VecDeque<StageFrame>,
}

impl Leader {
    /// A leader of this term, with a seed of random numbers.
    pub fn new(term: u32, seed: [u8; 32]) -> Self {
        Self {
            instance: StdRng::from_seed(seed).random(),
            term,
            channels: BTreeMap::new(),
            followers: BTreeMap::new(),
            roles: BTreeMap::new(),
            roles_number: 0,
            stops: 0,
            cues: VecDeque::new(),
            lead_s: LEAST_S,
            lead_ns: i64::MIN,
            dropped: 0,
        }
    }

    /// The random number that identifies this leader.
    pub fn instance(&self) -> u64 {
        self.instance
    }

    /// Number of leaders that led before this one.
    pub fn term(&self) -> u32 {
        self.term
    }

    /// The message with the next frame of a channel.
    pub fn frames(&mut self, now_ns: i64, channel: u8, style: &str, frame: StageFrame) -> Vec<u8> {
        let place = self.channels.entry(channel).or_default();
        if place.recent.len() == KEPT {
            place.recent.pop_front();
        }
        place.recent.push_back(frame);
        if place.style != style {
            style.clone_into(&mut place.style);
        }
        place.number += 1;
        let from = place.recent.len().saturating_sub(REDUNDANT);
        let (number, frames) = (place.number - 1, place.recent.range(from..).copied());
        let frames = frames.collect();
        self.frames_message(now_ns, channel, style, number, frames)
    }

    fn frames_message(
        &self,
        sent_ns: i64,
        channel: u8,
        style: &str,
        number: u64,
        frames: Vec<StageFrame>,
    ) -> Vec<u8> {
        let message = Frames {
            instance: self.instance,
            term: self.term,
            number,
            sent_ns,
            lead_ms: (self.lead_s * 1e3) as u16,
            channel,
            style: style.to_owned(),
            frames,
        };
        Message::Frames(message).encode()
    }

    /// The frames of a channel that were sent and are not yet over.
    fn resend(&self, now_ns: i64, channel: u8) -> Vec<Vec<u8>> {
        let Some(place) = self.channels.get(&channel) else {
            return Vec::new();
        };
        let over_ns = now_ns - (OVER_S * 1e9) as i64;
        let first = place.number - place.recent.len() as u64;
        let numbered: Vec<(u64, StageFrame)> = (first..)
            .zip(place.recent.iter().copied())
            .filter(|(_, frame)| frame.present_ns >= over_ns)
            .collect();
        let message = |part: &[(u64, StageFrame)]| {
            let number = part.last().map_or(0, |(number, _)| *number);
            let frames = part.iter().map(|(_, frame)| *frame).collect();
            self.frames_message(now_ns, channel, &place.style, number, frames)
        };
        numbered.chunks(MAX_FRAMES).map(message).collect()
    }

    /// Takes a message that arrived at `received_ns`; a reply is stamped by `now`.
    /// Errors: a malformed message, which is counted and dropped.
    pub fn receive(
        &mut self,
        received_ns: i64,
        bytes: &[u8],
        now: impl FnOnce() -> i64,
    ) -> Result<Outgoing, MessageError> {
        match Message::decode(bytes) {
            Ok(Message::TimeRequest(request)) => Ok(self.reply(received_ns, request, now)),
            Ok(Message::FollowerReport(report)) => {
                self.take_report(received_ns, report);
                Ok(Outgoing::Nothing)
            }
            Ok(Message::Cue(cue)) => Ok(self.take_cue(cue)),
            Ok(_) => Ok(self.drop_message()),
            Err(error) => {
                self.dropped += 1;
                Err(error)
            }
        }
    }

    fn drop_message(&mut self) -> Outgoing {
        self.dropped += 1;
        Outgoing::Nothing
    }

    fn take_cue(&mut self, cue: Cue) -> Outgoing {
        if self.cues.contains(&cue.nonce) {
            return self.drop_message();
        }
        if self.cues.len() == CUES {
            self.cues.pop_front();
        }
        self.cues.push_back(cue.nonce);
        let reached = self.reached_by(&cue.follower);
        let names = self.followers.values().map(|f| f.name.clone()).collect();
        let reply = CueReply { nonce: cue.nonce, reached: reached as u16, names };
        let known = self.roles.contains_key(&cue.follower);
        if !known && self.roles.len() == MAX_ROLES {
            return self.drop_message();
        }
        if reached > 0 {
            self.give_role(cue.follower, &cue.role);
        }
        Outgoing::Cued {
            nonce: reply.nonce,
            reply: Message::CueReply(reply).encode(),
            roles: self.roles(),
        }
    }

    fn reached_by(&self, follower: &str) -> usize {
        let is_for = |f: &&FollowerStatus| follower == "all" || f.name == follower;
        self.followers.values().filter(is_for).count()
    }

    fn give_role(&mut self, follower: String, change: &Role) {
        if follower == "all" {
            let all = self.roles.values_mut();
            all.for_each(|role| role.update(change));
        }
        self.roles.entry(follower).or_default().update(change);
    }

    /// Changes a role by the leader's own show: also that of a follower who is yet to come.
    /// How many followers it reaches now; `None` where there are too many roles.
    pub fn give(&mut self, follower: &str, change: &Role) -> Option<usize> {
        let known = self.roles.contains_key(follower);
        if !known && self.roles.len() == MAX_ROLES {
            return None;
        }
        self.give_role(follower.to_owned(), change);
        Some(self.reached_by(follower))
    }

    /// The changes that a follower of this name has got.
    pub fn role_of(&self, follower: &str) -> Role {
        let mut role = self.roles.get("all").cloned().unwrap_or_default();
        if let Some(own) = self.roles.get(follower) {
            role.update(own);
        }
        role
    }

    /// The message with all roles, to be sent again every second.
    pub fn roles(&mut self) -> Vec<u8> {
        self.roles_number += 1;
        let mut roles: Vec<(String, Role)> = self.roles.clone().into_iter().collect();
        // First the role for all, so that a follower's own role comes after it.
        roles.sort_by_key(|(name, _)| name != "all");
        let message =
            Roles { instance: self.instance, term: self.term, number: self.roles_number, roles };
        Message::Roles(message).encode()
    }

    /// Counts another emergency stop of the stage.
    pub fn stop(&mut self) {
        self.stops += 1;
    }

    /// The message with the newest stop, to be sent again until all have obeyed it.
    pub fn stop_message(&self) -> Vec<u8> {
        let stop = StageStop { instance: self.instance, number: self.stops };
        Message::StageStop(stop).encode()
    }

    /// The present lead: how long before their time frames are sent, seconds.
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

    /// The followers whose reports arrived recently.
    pub fn followers(&self) -> impl Iterator<Item = &FollowerStatus> {
        self.followers.values()
    }

    fn reply(
        &mut self,
        received_ns: i64,
        request: TimeRequest,
        now: impl FnOnce() -> i64,
    ) -> Outgoing {
        if request.instance != self.instance {
            return self.drop_message();
        }
        let reply = TimeReply {
            instance: self.instance,
            nonce: request.nonce,
            received_ns,
            replied_ns: now(),
        };
        let mut messages = vec![Message::TimeReply(reply).encode()];
        if let Some(channel) = request.resend {
            messages.extend(self.resend(received_ns, channel));
        }
        Outgoing::Reply(request.follower, messages)
    }

    fn take_report(&mut self, now_ns: i64, report: FollowerReport) {
        self.forget(now_ns);
        let known = self.followers.get(&report.follower);
        let old = known.is_some_and(|known| report.number <= known.number);
        let full = known.is_none() && self.followers.len() == FOLLOWERS;
        if report.instance != self.instance || old || full {
            self.dropped += 1;
            return;
        }
        let status = FollowerStatus {
            id: report.follower,
            name: report.name,
            needed_s: f64::from(report.needed_ms) * 1e-3,
            transit_s: f64::from(report.transit_ms) * 1e-3,
            lost: report.lost,
            style: report.style,
            number: report.number,
            heard_ns: now_ns,
        };
        self.followers.insert(report.follower, status);
    }

    fn forget(&mut self, now_ns: i64) {
        let gone_ns = (GONE_S * 1e9) as i64;
        self.followers.retain(|_, f| now_ns.saturating_sub(f.heard_ns) < gone_ns);
    }
}

#[cfg(test)]
mod tests;
