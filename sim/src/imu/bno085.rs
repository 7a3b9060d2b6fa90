//! The simulated BNO085 in its mode UART-RVC: a packet a measurement.

use servodance_drivers::imu::bno085::packet;

use super::{BoardTwin, Measured};

#[derive(Debug, Default)]
pub(super) struct Bno085Board {
    index: u8,
}

impl BoardTwin for Bno085Board {
    fn hear(&mut self, _byte: u8, _measured: &Measured, _out: &mut Vec<u8>) {}

    fn measure(&mut self, measured: &Measured, out: &mut Vec<u8>) {
        out.extend(packet(&measured.state, measured.yaw_rad, self.index));
        self.index = self.index.wrapping_add(1);
    }
}
