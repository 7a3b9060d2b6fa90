//! Messages that a follower receives: obeyed, or counted and dropped.

use super::Follower;
use super::tracked_leader::TrackedLeader;
use crate::clock::seconds;
use crate::messages::{Frames, Message, MessageError, Role, Roles, StageFrame, StageStop};

/// Longest plausible time between departure and presentation, seconds.
const FARTHEST_S: f64 = 20.0;
/// Largest number of channels of a leader.
const CHANNELS: usize = 8;
/// Leaders whose newest stop is remembered, so that each is obeyed once.
const STOPS: usize = 16;

impl Follower {
    /// Takes a message that arrived at `now_ns`.
    /// Errors: a malformed message, which is counted and dropped.
    pub fn receive(&mut self, now_ns: i64, bytes: &[u8]) -> Result<(), MessageError> {
        let message = Message::decode(bytes);
        let dropped = &mut self.stats.dropped;
        match &message {
            Err(MessageError::Huge(_)) => dropped.huge += 1,
            Err(MessageError::Version(_)) => dropped.other_version += 1,
            Err(_) => dropped.malformed += 1,
            Ok(Message::Frames(frames)) => self.take_frames(now_ns, frames),
            Ok(Message::TimeReply(reply)) => {
                let asked = |(nonce, instance, _): &(u64, u64, i64)| {
                    (*nonce, *instance) == (reply.nonce, reply.instance)
                };
                let place = self.pending.iter().position(asked);
                let Some((_, instance, asked_ns)) = place.and_then(|i| self.pending.remove(i))
                else {
                    dropped.unasked += 1;
                    return Ok(());
                };
                if let Some(leader) = self.tracked(instance) {
                    let clock = &mut leader.clock;
                    clock.push(asked_ns, reply.received_ns, reply.replied_ns, now_ns);
                    leader.mark_alive(now_ns);
                }
            }
            Ok(Message::Roles(roles)) => self.take_roles(now_ns, roles),
            Ok(Message::StageStop(stop)) => self.take_stop(stop),
            Ok(_) => dropped.misplaced += 1,
        }
        message.map(drop)
    }

    /// Notes that a liveliness token of a leader is gone on one of the connections.
    pub fn note_leader_gone(&mut self, instance: u64) {
        if let Some(leader) = self.tracked(instance) {
            leader.gone = true;
        }
    }

    fn take_frames(&mut self, now_ns: i64, frames: &Frames) {
        if self.retired.contains(&frames.instance) {
            self.stats.dropped.replayed += 1;
            return;
        }
        let sent_ns = frames.sent_ns;
        let believable =
            |frame: &StageFrame| seconds(frame.present_ns - sent_ns).abs() < FARTHEST_S;
        if !frames.frames.iter().all(believable) {
            self.stats.dropped.misplaced += 1;
            return;
        }
        if self.tracked(frames.instance).is_none() && !self.consider(now_ns, frames) {
            self.stats.dropped.rivals += 1;
            return;
        }
        let (current, channel) = (self.leader(), self.channel);
        let Some(leader) = self.tracked(frames.instance) else {
            return;
        };
        let newest = leader.newest.get(&frames.channel).copied();
        let wanted = match current == Some(frames.instance) {
            true => channel,
            false => 0,
        };
        if newest.is_some_and(|newest| frames.number <= newest) {
            // Frames resent on request; or a replay.
            let of_use = frames.channel == wanted && leader.take(frames) > 0;
            self.stats.dropped.replayed += u64::from(!of_use);
            return;
        }
        if newest.is_none() && leader.newest.len() == CHANNELS {
            self.stats.dropped.misplaced += 1;
            return;
        }
        leader.newest.insert(frames.channel, frames.number);
        leader.mark_alive(now_ns);
        leader.lead_s = f64::from(frames.lead_ms) * 1e-3;
        if leader.styles.len() < CHANNELS || leader.styles.contains_key(&frames.style) {
            leader.styles.insert(frames.style.clone(), frames.channel);
        }
        if let Some(newest) = frames.frames.last() {
            leader.music_start_ns = newest.present_ns - newest.music_ns;
        }
        if let Some(estimate) = leader.clock.estimate() {
            let transit_s = seconds(estimate.leader_ns(now_ns) - sent_ns);
            leader.transits.push(now_ns, transit_s.clamp(0.0, FARTHEST_S));
        }
        if frames.channel == wanted {
            leader.take(frames);
        }
        let term = leader.term;
        if current == Some(frames.instance) {
            // The leader is alive: no other of its term replaces it.
            self.candidate.take_if(|candidate| candidate.term <= term);
        }
    }

    /// Whether a new leader becomes the candidate.
    fn consider(&mut self, now_ns: i64, frames: &Frames) -> bool {
        let beats = |leader: &TrackedLeader| leader.is_lost(now_ns) || frames.term > leader.term;
        let better =
            self.current.as_ref().is_none_or(beats) && self.candidate.as_ref().is_none_or(beats);
        if better {
            self.candidate = Some(TrackedLeader::new(frames.instance, frames.term, now_ns));
        }
        better
    }

    /// Any leader's stop is obeyed, also one that is not followed now: to stop is always safe.
    fn take_stop(&mut self, stop: &StageStop) {
        if self
            .stopped_by
            .iter()
            .any(|known| known.instance == stop.instance && known.number >= stop.number)
        {
            self.stats.dropped.replayed += 1;
            return;
        }
        self.stopped_by.retain(|known| known.instance != stop.instance);
        if self.stopped_by.len() == STOPS {
            self.stopped_by.pop_front();
        }
        self.stopped_by.push_back(stop.clone());
        self.stops += 1;
    }

    fn take_roles(&mut self, now_ns: i64, roles: &Roles) {
        let (name, started) = (self.name.clone(), self.started.clone());
        let current = self.current.as_mut();
        let Some(leader) = current.filter(|leader| leader.instance == roles.instance) else {
            self.stats.dropped.rivals += 1;
            return;
        };
        if roles.number <= leader.roles_number {
            self.stats.dropped.replayed += 1;
            return;
        }
        leader.roles_number = roles.number;
        leader.mark_alive(now_ns);
        let mut role = started;
        let for_me = |(whom, _): &&(String, Role)| *whom == name || whom == "all";
        for (_, change) in roles.roles.iter().filter(for_me) {
            role.update(change);
        }
        self.role = role;
    }
}
