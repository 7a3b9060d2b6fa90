//! A servo that times out, or shuts down by itself, and its way back.

use servodance_types::JointState;

use super::config::ServoLost;
use super::error::SafetyError;
use super::joint::{LostServo, SafeJoint};
use super::lost_adapter::TRY_AGAIN_S;
use super::safe_bus::SafeBus;
use crate::bus::Bus;
use crate::error::{BusError, ServoId};

impl<B: Bus> SafeBus<B> {
    /// Acts on a cycle that failed: by policy sets lost servos aside, or waits for an
    /// adapter; all else is a fault.
    pub(super) fn cycle_failed(
        &mut self,
        now_s: f64,
        error: BusError,
        states: &mut [JointState],
    ) -> Result<(), SafetyError> {
        if matches!(error, BusError::Tripped { .. }) {
            return self.resume_stopped(now_s, error, states);
        }
        if matches!(error, BusError::Port { .. } | BusError::Link { .. } | BusError::BusOff { .. })
        {
            return self.lose_adapter(now_s, error);
        }
        let lost = self.indices_of(&error);
        let lost_before = self.joints.iter().filter(|joint| joint.lost.is_some());
        let gone = lost.len() + lost_before.count();
        let too_many = gone > (self.joints.len() / 4).max(1) || gone == self.joints.len();
        if lost.is_empty() || too_many || self.config.on_servo_lost == ServoLost::Stop {
            return Err(self.fault(now_s, error));
        }
        if !lost.iter().all(|&index| self.bus.set_aside(index)) {
            return Err(self.fault(now_s, error));
        }
        for index in lost {
            if let Some(joint) = self.joints.get_mut(index) {
                joint.lost = Some(LostServo {
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

    pub(super) fn indices_of(&self, error: &BusError) -> Vec<usize> {
        let named = match error {
            BusError::Silent { servos, .. }
            | BusError::Corrupt { servos, .. }
            | BusError::Tripped { servos, .. } => &servos[..],
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

    pub(super) fn missing(&self) -> Option<usize> {
        self.joints.iter().position(|joint| joint.lost.is_some())
    }

    pub(super) fn rejoin_lost(&mut self, now_s: f64, states: &mut [JointState]) {
        let due = |joint: &SafeJoint| joint.lost.as_ref().is_some_and(|l| l.next_try_s <= now_s);
        let Some(index) = self.joints.iter().position(due) else {
            return;
        };
        let who = self.id_of(index);
        let result = self.bus.rejoin(index);
        let Some(lost) = &mut self.joints[index].lost else { return };
        match result {
            Ok(None) => {}
            Ok(Some(state)) => {
                let away_s = now_s - lost.since_s;
                self.blend_in(now_s, index, state, states);
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
}
