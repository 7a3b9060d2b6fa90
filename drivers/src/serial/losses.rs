//! Answers that get lost in a cycle: a bad contact, a crimp that gives, a noisy motor.
//!
//! ```text
//! cycle: read all -- some missing --> ask those again, `retries` times
//!        -- still missing --> their state is reckoned, the dance goes on, it is counted
//!        -- missing for longer --> pinged, and BusError::Silent: a lost servo
//! ```
//!
//! A reckoned state goes on with the last speed. The goal of a packet that was lost is
//! repeated by the next cycle's: nobody knows that it was lost.
//!
//! How long somebody may be missing: `missing.rs`; how long an answer is waited for:
//! `patience.rs`.

use servodance_types::JointState;

use crate::error::{BusError, BusResult};
use crate::serial::bus::SerialBus;
use crate::serial::missing::{LOST_CYCLES, Missing};

/// A servo that answers pings and is never read whole for so long is lost as well, seconds.
const UNREAD_S: f64 = 0.25;

/// A state is reckoned over so long a cycle at most, seconds.
const RECKONED_S: f64 = 0.05;

impl SerialBus {
    /// Reads everyone's present state for a cycle; rides single losses out.
    pub(super) fn read_cycle(&mut self) -> BusResult<()> {
        let damaged = self.client.port.stats.crc_errors;
        self.client.waits_for_cycle = true;
        let read = self.read_patiently();
        self.client.waits_for_cycle = false;
        if read? {
            self.missing.fill(Missing::default());
            return Ok(());
        }
        let now_s = self.client.config.reply_clock.now_s();
        let mut lost = false;
        let others_answer = self.client.anyone_answered();
        self.client.port.stats.unheard += u64::from(!others_answer);
        for (index, missing) in self.missing.iter_mut().enumerate() {
            if self.client.answered[index] {
                *missing = Missing::default();
            } else {
                self.client.errors.reckoned(index);
                lost |= missing.again(now_s, others_answer);
            }
        }
        if lost && self.is_anyone_gone(now_s)? {
            self.missing.fill(Missing::default());
            let corrupt = self.client.port.stats.crc_errors > damaged;
            return Err(self.client.name_the_silent(corrupt));
        }
        Ok(())
    }

    /// Asks those who are missing by themselves. One that answers a ping is there, however
    /// damaged the line is, until it has been missing for long.
    fn is_anyone_gone(&mut self, now_s: f64) -> BusResult<bool> {
        for index in 0..self.missing.len() {
            if self.missing[index].cycles < LOST_CYCLES {
                continue;
            }
            if self.missing[index].since_s.is_some_and(|since_s| now_s - since_s >= UNREAD_S) {
                return Ok(true);
            }
            match self.client.ping(index) {
                Err(BusError::Silent { .. }) => return Ok(true),
                Ok(_) | Err(BusError::Refused { .. } | BusError::Corrupt { .. }) => {
                    self.missing[index].cycles = 0;
                }
                Err(error) => return Err(error),
            }
        }
        Ok(false)
    }

    /// The states of a cycle: as read, or reckoned over `passed_s` where nobody answered.
    pub(super) fn copy_cycle(&self, passed_s: f64, states: &mut [JointState]) {
        for (index, state) in states.iter_mut().enumerate() {
            if self.client.answered[index] && !self.client.aside[index] {
                *state = self.state_of(index);
            } else if !self.client.aside[index] {
                state.position_rad += state.velocity_rad_s * passed_s.clamp(0.0, RECKONED_S);
            }
        }
    }
}
