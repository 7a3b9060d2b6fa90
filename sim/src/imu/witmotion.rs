//! The simulated WitMotion board on a serial port: three packets a measurement.

use servodance_drivers::imu::witmotion::packets;

use super::{BoardTwin, Measured};

#[derive(Debug)]
pub(super) struct WitmotionBoard;

impl BoardTwin for WitmotionBoard {
    fn hear(&mut self, _byte: u8, _measured: &Measured, _out: &mut Vec<u8>) {}

    fn measure(&mut self, measured: &Measured, out: &mut Vec<u8>) {
        out.extend(packets(&measured.state, measured.yaw_rad).as_flattened());
    }
}
