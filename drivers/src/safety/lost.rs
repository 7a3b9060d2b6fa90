//! Servos and adapters that are lost, and their way back.

use servodance_types::JointState;

use super::{Joint, SafeBus, SafetyError, ServoLost, State};
use crate::bus::Bus;
use crate::error::{BusError, ServoId};
use crate::limiter::Limiter;

/// A lost servo, or an adapter, is tried again after this, seconds.
const TRY_AGAIN_S: f64 = 0.25;

/// A servo that is set aside.
#[derive(Clone, Debug)]
pub(super) struct Lost {
    pub since_s: f64,
    pub next_try_s: f64,
    /// Why it could not come back last time.
    pub reason: String,
}

/// An adapter that was pulled out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unplugged {
    since_s: f64,
    next_try_s: f64,
    /// Whether it is waited for.
    waiting: bool,
}

impl<B: Bus> SafeBus<B> {
    /// A cycle failed: by policy the lost servos are set aside, or an adapter
    /// is waited for; all else is a fault.
    pub(super) fn failed(&mut self, now_s: f64, error: BusError) -> Result<(), SafetyError> {
        if matches!(
            error,
            BusError::Port { .. } | BusError::Link { .. } | BusError::BusOff { .. }
        ) {
            self.unplugged = Some(Unplugged {
                since_s: now_s,
                next_try_s: now_s + TRY_AGAIN_S,
                waiting: self.config.rearm,
            });
            if !self.config.rearm {
                return Err(self.fault(now_s, error));
            }
            self.enter(
                now_s,
                State::Fault,
                &format!("{error}; waiting for the adapter"),
            );
            // Other buses lose torque at once; this one's servos have their watchdog.
            let _ = self.bus.disarm();
            return Ok(());
        }
        let lost = self.indices_of(&error);
        let gone = lost.len()
            + self
                .joints
                .iter()
                .filter(|joint| joint.lost.is_some())
                .count();
        let too_many = gone > (self.joints.len() / 4).max(1) || gone == self.joints.len();
        if lost.is_empty() || too_many || self.config.on_servo_lost == ServoLost::Stop {
            return Err(self.fault(now_s, error));
        }
        if !lost.iter().all(|&index| self.bus.set_aside(index)) {
            return Err(self.fault(now_s, error));
        }
        for index in lost {
            if let Some(joint) = self.joints.get_mut(index) {
                joint.lost = Some(Lost {
                    since_s: now_s,
                    next_try_s: now_s + TRY_AGAIN_S,
                    reason: String::new(),
                });
                joint.away_since_s = None;
            }
        }
        self.remark(now_s, &format!("{error}; the others go on"));
        Ok(())
    }

    /// The servos that an error speaks of; none if it is not about single servos.
    fn indices_of(&self, error: &BusError) -> Vec<usize> {
        let named = match error {
            BusError::Silent { servos, .. } | BusError::Corrupt { servos, .. } => &servos[..],
            BusError::Hardware { servo, .. } | BusError::Refused { servo, .. } => {
                std::slice::from_ref(servo)
            }
            _ => &[],
        };
        let place = |id: &ServoId| self.bus.servos().iter().position(|s| s.name == id.joint);
        let places: Vec<usize> = named.iter().filter_map(place).collect();
        let new = |&&index: &&usize| self.joints.get(index).is_some_and(|j| j.lost.is_none());
        places.iter().filter(new).copied().collect()
    }

    /// The first servo that is set aside.
    pub(super) fn missing(&self) -> Option<usize> {
        self.joints.iter().position(|joint| joint.lost.is_some())
    }

    /// One step of the way back of one lost servo.
    pub(super) fn take_back(&mut self, now_s: f64, states: &mut [JointState]) {
        let due = |joint: &Joint| joint.lost.as_ref().is_some_and(|l| l.next_try_s <= now_s);
        let Some(index) = self.joints.iter().position(due) else {
            return;
        };
        let who = self.id_of(index);
        let result = self.bus.rejoin(index);
        let limits = self.bus.servos()[index].limits;
        let joint = &mut self.joints[index];
        let Some(lost) = &mut joint.lost else { return };
        match result {
            Ok(None) => {}
            Ok(Some(state)) => {
                let away_s = now_s - lost.since_s;
                let held = limits.clamp_rad(state.position_rad);
                joint.limiter = Limiter::new(limits, 1.0 / self.config.control_hz, held);
                joint.ramp_from_rad = held;
                joint.ramp_began_s = Some(now_s);
                joint.lost = None;
                self.sent_rad[index] = held;
                states[index] = state;
                self.remark(now_s, &format!("{who} is back after {away_s:.1} s"));
            }
            Err(error) => {
                lost.next_try_s = now_s + TRY_AGAIN_S;
                let reason = error.to_string();
                if lost.reason != reason {
                    lost.reason = reason;
                    let remark = format!("{who} is not back: {error}");
                    self.remark(now_s, &remark);
                }
            }
        }
    }

    /// Waits for an adapter that was pulled out, checks the bus and arms it.
    pub(super) fn reconnect(
        &mut self,
        now_s: f64,
        states: &mut [JointState],
    ) -> Result<State, SafetyError> {
        let Some(unplugged) = self.unplugged.as_mut().filter(|u| u.waiting) else {
            return Err(self.misplaced("tick"));
        };
        if now_s < unplugged.next_try_s {
            return Ok(self.state);
        }
        let away_s = now_s - unplugged.since_s;
        unplugged.next_try_s = now_s + TRY_AGAIN_S;
        unplugged.waiting = away_s < self.config.reconnect_s;
        let last_try = !unplugged.waiting;
        let armed = self.bus.reopen().and_then(|()| self.bus.arm());
        match armed {
            Ok(report) => {
                let cause = format!("the adapter is back after {away_s:.1} s");
                self.enter(now_s, State::Arming, &cause);
                states.copy_from_slice(&report.states);
                self.armed(now_s, &report.states);
                Ok(self.state)
            }
            Err(error) if last_try => Err(self.fault(now_s, error)),
            Err(_) => Ok(self.state),
        }
    }
}
