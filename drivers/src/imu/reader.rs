//! Reads a board once a cycle, and knows how old the last reading is.

use std::time::Duration;

use servodance_types::ImuState;

use super::config::ImuConfig;
use super::freshness::Freshness;
use super::mounting::Mounting;
use super::opencr::{READING_BYTES, decode, registers::READING};
use crate::error::BusResult;
use crate::serial::ServoClient;
use crate::serial::device_read::DeviceQuestion;

/// How often a board that is lost is asked again, seconds.
const ASK_AGAIN_S: f64 = 0.5;
/// How much of a control period is waited for an answer beyond its time on the wire.
const PATIENCE: f64 = 0.4;

/// A board on a serial bus.
#[derive(Debug)]
pub(crate) struct ImuReader {
    id: u8,
    mounting: Mounting,
    hz: f64,
    patience: Duration,
    fresh: Freshness,
    asked: Option<DeviceQuestion>,
}

impl ImuReader {
    /// For a bus that is cycled so many times a second.
    pub fn new(config: &ImuConfig, hz: f64, reply_timeout_ms: f64) -> Self {
        let patience_s = (reply_timeout_ms * 1e-3).min(PATIENCE / hz);
        Self {
            id: config.id(),
            mounting: config.mounting(),
            hz,
            patience: Duration::from_secs_f64(patience_s),
            fresh: Freshness::new(hz),
            asked: None,
        }
    }

    /// Asks the board, with what is held for the wire, unless it is lost and was asked a moment
    /// ago.
    pub fn ask(&mut self, client: &mut ServoClient) -> BusResult<()> {
        let again = (ASK_AGAIN_S * self.hz).ceil().max(1.0) as u32;
        let waits = self.fresh.is_lost() && !self.fresh.missed().is_multiple_of(again);
        self.asked = match waits {
            true => None,
            false => Some(client.ask_device(self.id, READING, self.patience)?),
        };
        Ok(())
    }

    /// Waits for what the board answers to [`ImuReader::ask`].
    pub fn hear(&mut self, client: &mut ServoClient) -> BusResult<()> {
        let bytes: Option<[u8; READING_BYTES]> = match self.asked.take() {
            None => None,
            Some(asked) => client.hear_device(&asked)?,
        };
        self.fresh.cycle(bytes.map(|bytes| decode(&bytes, &self.mounting)));
        Ok(())
    }

    /// The last reading, unless it is too old.
    pub fn state(&self) -> Option<ImuState> {
        self.fresh.state()
    }

    /// What the user should know before torque.
    pub fn note(&self) -> Option<String> {
        let id = self.id;
        let text =
            || format!("the motion sensor (id {id}) does not answer: balance goes without it");
        self.fresh.state().is_none().then(text)
    }
}
