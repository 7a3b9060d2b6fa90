//! An adapter that is pulled out, and the bus when the adapter is back.

use servodance_types::JointState;

use super::error::SafetyError;
use super::joint::LostAdapter;
use super::safe_bus::SafeBus;
use super::state::State;
use crate::bus::Bus;
use crate::error::BusError;

/// Seconds between two attempts to take back a servo or an adapter.
pub(super) const TRY_AGAIN_S: f64 = 0.25;

impl<B: Bus> SafeBus<B> {
    /// Faults; with `rearm` without an error, and [`SafeBus::tick`] then waits.
    pub(super) fn lose_adapter(&mut self, now_s: f64, error: BusError) -> Result<(), SafetyError> {
        self.adapter = Some(LostAdapter {
            since_s: now_s,
            next_try_s: now_s + TRY_AGAIN_S,
            waiting: self.config.rearm,
        });
        if !self.config.rearm {
            return Err(self.fault(now_s, error));
        }
        let cause = format!("{error}; waiting for the adapter");
        self.enter(now_s, State::Fault, &cause);
        // Other buses lose torque at once; this one's servos have their watchdog.
        let _ = self.bus.disarm();
        Ok(())
    }

    /// Waits for an adapter that was pulled out, checks the bus and arms it.
    pub(super) fn reconnect(
        &mut self,
        now_s: f64,
        states: &mut [JointState],
    ) -> Result<State, SafetyError> {
        let Some(adapter) = self.adapter.as_mut().filter(|adapter| adapter.waiting) else {
            return Err(self.misplaced("tick"));
        };
        if now_s < adapter.next_try_s {
            return Ok(self.state);
        }
        let away_s = now_s - adapter.since_s;
        adapter.next_try_s = now_s + TRY_AGAIN_S;
        adapter.waiting = away_s < self.config.reconnect_s;
        let last_try = !adapter.waiting;
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
