//! A WitMotion board on the robot's CAN bus: its frames come unasked between those of the
//! motors.

use servodance_types::ImuState;

use super::config::ImuConfig;
use super::freshness::Freshness;
use super::mounted;
use super::mounting::Mounting;
use super::witmotion::Witmotion;
use crate::can::transport::CanFrame;

pub(crate) struct CanImu {
    id: u32,
    board: Witmotion,
    mounting: Mounting,
    newest: Option<ImuState>,
    fresh: Freshness,
}

impl CanImu {
    /// For a bus that is cycled so many times a second.
    pub fn new(config: &ImuConfig, hz: f64) -> Self {
        Self {
            id: u32::from(config.id()),
            board: Witmotion::new(),
            mounting: config.mounting(),
            newest: None,
            fresh: Freshness::new(hz),
        }
    }

    /// Takes a frame of the bus; whether it was the sensor's.
    pub fn hear(&mut self, frame: &CanFrame) -> bool {
        let is_own = frame.id() == self.id && !frame.is_extended();
        if is_own {
            let reading = self.board.hear_frame(frame.data());
            self.newest = reading.map(|board| mounted(&board, &self.mounting)).or(self.newest);
        }
        is_own
    }

    /// A cycle is over.
    pub fn cycle(&mut self) {
        self.fresh.cycle(self.newest.take());
    }

    pub fn state(&self) -> Option<ImuState> {
        self.fresh.state()
    }
}
