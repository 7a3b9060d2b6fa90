//! How a servo that was set aside comes back, in steps that are short enough to be
//! done between two cycles:
//!
//! ```text
//! Find (ping) -> reboot if it shut down -> Check (model, limits, condition)
//!      -> SetUp (torque off, settings) -> Engage (goal = present, watchdog, torque)
//! ```

use servodance_types::JointState;

use crate::error::BusResult;
use crate::serial::bus::{RejoinStep, SerialBus};

impl SerialBus {
    pub(super) fn advance_rejoin(&mut self, index: usize) -> BusResult<Option<JointState>> {
        let step = match self.returning {
            Some((who, step)) if who == index => step,
            _ => RejoinStep::Find,
        };
        // A servo that was rebooted is waited for; all else begins anew.
        let again = match step {
            RejoinStep::FindRebooted => Some((index, step)),
            _ => None,
        };
        self.returning = again;
        match self.step_back(index, step)? {
            Err(next) => {
                self.returning = Some((index, next));
                Ok(None)
            }
            Ok(state) => {
                self.returning = None;
                Ok(Some(state))
            }
        }
    }

    /// One step of a servo's way back; the next one, or its state when it is back.
    fn step_back(
        &mut self,
        index: usize,
        step: RejoinStep,
    ) -> BusResult<Result<JointState, RejoinStep>> {
        match step {
            RejoinStep::Find | RejoinStep::FindRebooted => {
                self.client.once(|client| client.ping(index))?;
                let condition = self.family.condition(&mut self.client, index)?;
                if condition.is_some() && step == RejoinStep::Find {
                    return Ok(Err(match self.family.reboot(&mut self.client, index)? {
                        true => RejoinStep::FindRebooted,
                        false => RejoinStep::SetUp,
                    }));
                }
                Ok(Err(RejoinStep::Check))
            }
            RejoinStep::Check => {
                let pinged = self.client.ping(index)?;
                self.check(index, &pinged)?;
                Ok(Err(RejoinStep::SetUp))
            }
            RejoinStep::SetUp => {
                let mut already_told = Vec::new();
                self.family.set_up(&mut self.client, index, &mut already_told)?;
                Ok(Err(RejoinStep::Engage))
            }
            RejoinStep::Engage => {
                self.client.check_condition(self.family, index)?;
                let registers = self.family.registers();
                let bytes = self.client.read_bytes(index, registers.present)?;
                self.present[index * bytes.len()..][..bytes.len()].copy_from_slice(&bytes);
                self.hold_here(index)?;
                self.client.set(index, registers.torque, 1)?;
                self.client.aside[index] = false;
                Ok(Ok(self.state_of(index)))
            }
        }
    }
}
