//! What happens when a servo times out.
//!
//! ```text
//! request -- no reply by the deadline --> the same again, `retries` times
//!         -- still none --> BusError::Silent with the joints that are missing
//! cycle   -- none for a while (losses.rs) --> Silent
//!         -- Silent --> SafeBus: the servo is set aside or the robot stops
//!         -- set aside --> rejoin, step by step, between cycles
//! ```
//!
//! The deadline is the time on the wire, the longest return delay of each servo,
//! and `reply_timeout_ms`; in a cycle less, as learnt from the answers before (`patience.rs`). A reply that comes after it does not pass for that of
//! the next request (`wire/stale_replies.rs`). `safety/lost_servo.rs`
//! decides what becomes of the robot, `rejoin.rs` takes a servo back.

use std::time::{Duration, Instant};

use crate::error::{BusError, BusResult, ServoId};
use crate::serial::client::ServoClient;

/// Return delay that a servo has before it is set to zero: 254 units of 2 us.
pub(super) const LONGEST_RETURN_DELAY: Duration = Duration::from_micros(508);

impl ServoClient {
    pub(crate) fn tries(&self) -> u32 {
        self.tries
    }

    /// When a reply of `bytes` from `servos` servos to what was just sent must be there.
    pub(crate) fn deadline(&self, bytes: usize, servos: usize) -> Instant {
        Instant::now() + self.wait(bytes, servos)
    }

    pub(super) fn wait(&self, bytes: usize, servos: usize) -> Duration {
        let longest_s = self.config.reply_timeout_ms * 1e-3;
        let learnt = match (self.waits_for_cycle, self.asks_again_soon) {
            (false, _) => None,
            (true, false) => self.patience.wait(longest_s),
            (true, true) => self.patience.short_wait(longest_s),
        };
        // What was learnt has the servos' return delays in it.
        let beyond = learnt.unwrap_or_else(|| {
            LONGEST_RETURN_DELAY * servos as u32 + Duration::from_secs_f64(longest_s)
        });
        self.port.passing() + self.port.time(bytes) + beyond
    }

    /// Learns from a cycle's question whose answer is whole, `bytes` long.
    pub(crate) fn learn(&mut self, bytes: usize) {
        let due = self.port.passed() + self.port.time(bytes);
        let late = due.elapsed();
        self.port.stats.note_delay(&self.config.reply_clock, late);
        self.patience.answered(late.as_secs_f64());
    }

    /// Learns from a question whose answer was not there in time.
    pub(crate) fn learn_loss(&mut self) {
        self.patience.lost(self.config.reply_timeout_ms * 1e-3);
    }

    /// Does something without retries.
    pub(crate) fn once<T>(&mut self, exchange: impl FnOnce(&mut Self) -> T) -> T {
        let tries = std::mem::replace(&mut self.tries, 1);
        let result = exchange(self);
        self.tries = tries;
        result
    }

    pub(crate) fn unanswered(
        &self,
        servos: Vec<ServoId>,
        corrupt: bool,
        doing: &'static str,
    ) -> BusError {
        let tries = self.tries;
        if corrupt {
            BusError::Corrupt { servos, doing, tries }
        } else {
            BusError::Silent { servos, doing, tries, hint: String::new() }
        }
    }

    pub(crate) fn ping_all(&mut self) -> BusResult<Vec<Vec<u8>>> {
        let mut silent = Vec::new();
        let mut answers = Vec::with_capacity(self.servos.len());
        for index in 0..self.servos.len() {
            match self.ping(index) {
                Ok(answer) => answers.push(answer),
                Err(BusError::Silent { servos, .. }) => silent.extend(servos),
                Err(error) => return Err(error),
            }
        }
        if silent.is_empty() {
            return Ok(answers);
        }
        let baud = self.config.baud;
        let hint = format!(
            " at {baud} baud: power, wiring, id? `servodance scan` finds servos at every rate"
        );
        Err(BusError::Silent { servos: silent, doing: "ping", tries: self.tries, hint })
    }

    /// One missing servo silences those behind it: ask each by itself, once,
    /// who it is. Where nobody answers at all, the first few speak for all.
    pub(crate) fn name_the_silent(&mut self, corrupt: bool) -> BusError {
        const ENOUGH: usize = 3;
        let missing: Vec<usize> =
            (0..self.servos.len()).filter(|&index| !self.answered[index]).collect();
        let mut silent = Vec::new();
        let mut heard = missing.len() < self.servos.len();
        for &index in &missing {
            if !heard && silent.len() == ENOUGH {
                silent = missing.clone();
                break;
            }
            match self.once(|client| client.ping(index)) {
                Err(BusError::Silent { .. }) => silent.push(index),
                Ok(_) | Err(BusError::Refused { .. } | BusError::Corrupt { .. }) => heard = true,
                Err(error) => return error,
            }
        }
        let corrupt = corrupt && silent.is_empty();
        let named = if silent.is_empty() { missing } else { silent };
        let servos = named.iter().map(|&index| self.id_of(index)).collect();
        self.unanswered(servos, corrupt, "present state")
    }
}
