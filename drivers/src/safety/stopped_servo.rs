//! Servos that their own watchdog has stopped, because the host was kept from running:
//! torque is on, they stand still, and they refuse every goal.
//!
//! After a short silence (`resume_s`) they are taken on again as arming does it: each
//! holds where it stands, and the targets are blended in over `ramp_s`. After a longer
//! one, after too many in a row, or where one does not come back, torque goes off.

use servodance_types::JointState;

use super::error::SafetyError;
use super::safe_bus::SafeBus;
use crate::bus::Bus;
use crate::error::BusError;

/// So many silences are taken in one [`WINDOW_S`]; then the host is not fit to drive a robot.
const MOST: usize = 3;
const WINDOW_S: f64 = 10.0;
const SAME_S: f64 = 0.5;

impl<B: Bus> SafeBus<B> {
    /// Asks a joint that does not move although its command does whether it is stopped.
    pub(super) fn watch_stillness(
        &mut self,
        now_s: f64,
        states: &mut [JointState],
    ) -> Result<(), SafetyError> {
        let sent = self.sent_rad.iter().zip(states.iter());
        let mut stopped = None;
        for (index, (joint, (sent_rad, state))) in self.joints.iter_mut().zip(sent).enumerate() {
            let still = joint.stillness.looks_stopped(now_s, state.position_rad, *sent_rad);
            if still && joint.lost.is_none() {
                stopped = Some(index);
            }
        }
        match stopped.map(|index| self.bus.examine(index)) {
            Some(Err(error @ BusError::Tripped { .. })) => self.cycle_failed(now_s, error, states),
            // Blocked, or slow: the following error decides.
            _ => Ok(()),
        }
    }

    /// Takes servos on again that their own watchdog has stopped, or faults.
    pub(super) fn resume_stopped(
        &mut self,
        now_s: f64,
        error: BusError,
        states: &mut [JointState],
    ) -> Result<(), SafetyError> {
        let silent_s = match &error {
            BusError::Tripped { silent_s, .. } => silent_s.unwrap_or(0.0),
            _ => 0.0,
        };
        self.stops_s.retain(|stop_s| now_s - stop_s < WINDOW_S);
        // Each bus of a robot tells of the same silence by itself.
        if self.stops_s.last().is_none_or(|last_s| now_s - last_s > SAME_S) {
            self.stops_s.push(now_s);
        }
        let allowed = self.config.resume_s > 0.0 && silent_s <= self.config.resume_s;
        if !allowed || self.stops_s.len() > MOST {
            return Err(self.fault(now_s, error));
        }
        let stopped = self.indices_of(&error);
        self.remark(now_s, &format!("{error}; taking them on again where they stand"));
        for &index in &stopped {
            match self.bus.resume(index) {
                Ok(state) => self.blend_in(now_s, index, state, states),
                Err(error) => return Err(self.fault(now_s, error)),
            }
        }
        let ramp_s = self.config.ramp_s;
        let count = stopped.len();
        self.remark(now_s, &format!("{count} of them follow again, blended in over {ramp_s} s"));
        Ok(())
    }

    /// A joint that holds at `state` begins from there: its limits, and its ramp.
    pub(super) fn blend_in(
        &mut self,
        now_s: f64,
        index: usize,
        state: JointState,
        states: &mut [JointState],
    ) {
        let held = self.bus.servos()[index].limits.clamp_rad(state.position_rad);
        self.joints[index].begin_at(now_s, held);
        self.sent_rad[index] = held;
        states[index] = state;
    }
}
