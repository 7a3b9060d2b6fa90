//! One motor on its bus, as its family reaches it: requests with retries, and errors
//! that name the servo.

use crate::bus::config::BusConfig;
use crate::can::exchange::CanExchange;
use crate::can::transport::CanFrame;
use crate::error::{BusError, BusResult};
use crate::servo::Servo;

/// Reaches the motor at `index` of a bus.
pub(crate) struct MotorClient<'a> {
    pub bus: &'a mut CanExchange,
    pub index: usize,
}

impl MotorClient<'_> {
    pub fn servo(&self) -> &Servo {
        &self.bus.servos[self.index]
    }

    pub fn config(&self) -> &BusConfig {
        &self.bus.config
    }

    /// Sends a request until `accept` finds its answer: a value, or the motor's refusal.
    pub fn ask<T>(
        &mut self,
        request: &CanFrame,
        doing: &'static str,
        accept: impl Fn(&Servo, &CanFrame) -> Option<Result<T, String>>,
    ) -> BusResult<T> {
        for attempt in 0..self.bus.tries {
            self.bus.stats.retries += u64::from(attempt > 0);
            let deadline = self.bus.deadline(2 + self.bus.servos.len());
            self.bus.transmit(request, deadline, doing)?;
            while let Some(frame) = self.bus.receive(deadline, doing)? {
                match accept(self.servo(), &frame) {
                    Some(Ok(value)) => return Ok(value),
                    Some(Err(said)) => {
                        return Err(BusError::Said {
                            servo: self.bus.id_of(self.index),
                            doing,
                            said,
                        });
                    }
                    None => {}
                }
            }
            self.bus.stats.timeouts += 1;
        }
        Err(self.bus.silent(vec![self.bus.id_of(self.index)], doing))
    }

    /// Sends frames without waiting for answers.
    pub fn send(&mut self, frames: &[CanFrame], doing: &'static str) -> BusResult<()> {
        let deadline = self.bus.deadline(frames.len());
        let mut frames = frames.iter();
        frames.try_for_each(|frame| self.bus.transmit(frame, deadline, doing))
    }

    /// The note for the user where a motor without watchdog is accepted.
    pub fn without_watchdog(&self, why: String) -> BusResult<String> {
        let servo = self.bus.id_of(self.index);
        if !self.config().accept_no_watchdog {
            return Err(BusError::NoWatchdog { servo, why });
        }
        Ok(format!("{servo}: no watchdog: without a host it holds its last target"))
    }

    pub fn unfit(
        &self,
        what: &'static str,
        actual: impl ToString,
        wanted: impl ToString,
    ) -> BusError {
        BusError::Unfit {
            servo: self.bus.id_of(self.index),
            what,
            actual: actual.to_string(),
            wanted: wanted.to_string(),
        }
    }

    pub fn verify<T: PartialEq + ToString>(
        &self,
        what: &'static str,
        actual: T,
        wanted: T,
    ) -> BusResult<()> {
        match actual == wanted {
            true => Ok(()),
            false => Err(self.unfit(what, actual, wanted)),
        }
    }

    /// The same for a number that the motor keeps as f32.
    pub fn verify_f32(&self, what: &'static str, actual: f64, wanted: f64) -> BusResult<()> {
        if (actual - wanted).abs() <= 1e-5 * wanted.abs().max(1.0) {
            return Ok(());
        }
        Err(self.unfit(what, actual, wanted))
    }
}
