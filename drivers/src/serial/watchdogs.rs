//! Servos that their own watchdog has stopped: they refuse goals without a word. A Sync
//! Write is not answered, and a read tells where a servo stands and not why.
//!
//! After a silence as long as the watchdogs' time (`silence.rs`) everyone is asked,
//! **before** the next goal is sent, and again in each cycle until nobody is stopped.

use servodance_types::JointState;

use crate::error::{BusError, BusResult};
use crate::serial::bus::SerialBus;

impl SerialBus {
    /// Refuses a cycle after a silence in which servos have stopped themselves; how long
    /// ago the last cycle began, seconds.
    pub(super) fn watch_silence(&mut self) -> BusResult<f64> {
        let config = &self.client.config;
        let watchdog_s = f64::from(config.watchdog_ms) * 1e-3;
        let now_s = config.reply_clock.now_s();
        let passed_s = now_s - self.silence.spoke_s;
        if self.silence.begin_cycle(now_s, watchdog_s).is_some() {
            self.refuse_tripped(None)?;
            self.silence.doubtful_s = None;
        }
        Ok(passed_s)
    }

    /// An error that names those whose watchdog has tripped: of everyone, or `who` alone.
    pub(super) fn refuse_tripped(&mut self, who: Option<usize>) -> BusResult<()> {
        let tripped = self.family.tripped(&mut self.client, who)?;
        if tripped.is_empty() {
            return Ok(());
        }
        let servos = tripped.into_iter().map(|index| self.client.id_of(index)).collect();
        let silent_s = who.map_or(self.silence.doubtful_s, |_| None);
        Err(BusError::Tripped { servos, silent_s })
    }

    /// One servo takes goals again from where it stands, in the order in which arming does
    /// it: the goal first, then the watchdog, then a look whether torque is still on.
    pub(super) fn resume_stopped(&mut self, index: usize) -> BusResult<JointState> {
        let registers = self.family.registers();
        let bytes = self.client.read_bytes(index, registers.present)?;
        self.present[index * bytes.len()..][..bytes.len()].copy_from_slice(&bytes);
        self.family.clear_watchdog(&mut self.client, index)?;
        self.hold_here(index)?;
        self.client.expect(index, registers.torque, 1)?;
        Ok(self.state_of(index))
    }
}
