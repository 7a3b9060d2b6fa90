//! What a follower makes of messages: heeded, or counted and dropped.

use super::led::Led;
use super::{Follower, seconds};
use crate::wire::{Frames, Message, Role, Roles, StageFrame, WireError};

/// A frame is not meant for a moment farther from its sending, seconds.
const FARTHEST_S: f64 = 20.0;
/// Voices of a leader that are told apart.
const VOICES: usize = 8;

impl Follower {
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

    /// A liveliness token of a leader went away, as one of the connections has it.
    pub fn leader_gone(&mut self, instance: u64) {
        if let Some(led) = self.led(instance) {
            led.gone = true;
        }
    }

    fn hear_frames(&mut self, now_ns: i64, frames: &Frames) {
        if self.retired.contains(&frames.instance) {
            self.figures.dropped.replayed += 1;
            return;
        }
        let sent_ns = frames.sent_ns;
        let believable =
            |frame: &StageFrame| seconds(frame.present_ns - sent_ns).abs() < FARTHEST_S;
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
        let wanted = match current == Some(frames.instance) {
            true => voice,
            false => 0,
        };
        if newest.is_some_and(|newest| frames.number <= newest) {
            // What was sent before this robot came, and asked for; or a replay.
            let of_use = frames.voice == wanted && led.take(frames) > 0;
            self.figures.dropped.replayed += u64::from(!of_use);
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
        if frames.voice == wanted {
            led.take(frames);
        }
        let term = led.term;
        if current == Some(frames.instance) {
            // It is there after all: nobody of its term takes its place.
            self.candidate.take_if(|candidate| candidate.term <= term);
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
}
