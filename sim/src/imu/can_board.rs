//! A simulated WitMotion board among the motors of a CAN bus.

use servodance_drivers::ImuConfig;
use servodance_drivers::can::CanFrame;
use servodance_drivers::imu::witmotion::frames;

use super::{MEASURED_S, Sensed};
use crate::world::SharedWorld;

#[derive(Debug)]
pub(crate) struct CanBoard {
    id: u32,
    sensed: Sensed,
    time_s: f64,
    measured: u64,
    pub silent: bool,
}

impl CanBoard {
    pub fn new(config: &ImuConfig, world: Option<SharedWorld>) -> Self {
        let sensed = Sensed::new(config, world);
        Self { id: u32::from(config.id()), sensed, time_s: 0.0, measured: 0, silent: false }
    }

    pub fn step(&mut self, dt_s: f64) {
        self.time_s += dt_s;
    }

    /// The frames of what was measured last, once a hundredth of a second.
    pub fn due(&mut self) -> Vec<CanFrame> {
        let due = (self.time_s / MEASURED_S + 1e-6) as u64;
        let missed = due - std::mem::replace(&mut self.measured, due);
        if missed == 0 {
            return Vec::new();
        }
        let now = self.sensed.after(missed as f64 * MEASURED_S);
        if self.silent {
            return Vec::new();
        }
        let data = frames(&now.state, now.yaw_rad);
        data.map(|data| CanFrame::standard(self.id, &data)).into()
    }
}
