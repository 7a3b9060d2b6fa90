//! What a family of CAN motors must be able to say. [`crate::can::CanBus`] does
//! the rest, the same for all.

use crate::bus::Health;
use crate::can::exchange::{Exchange, Status};
use crate::can::frame::CanFrame;
use crate::error::BusError;
use crate::servo::Servo;

/// The language of a family of motors.
pub(crate) trait Protocol: Send {
    /// Turns one motor's torque off and asks where it stands and how it is.
    /// The motor confirms both; a motor that cannot say whether it drives
    /// confirms by answering.
    fn release(&self, bus: &mut Exchange, index: usize) -> Result<Status, BusError>;

    /// Checks and sets up one motor whose torque is off: what it is, ranges,
    /// modes, limits, watchdog, each read back. Notes are for the user.
    fn prepare(
        &self,
        bus: &mut Exchange,
        index: usize,
        notes: &mut Vec<String>,
    ) -> Result<(), BusError>;

    /// Turns torque on so that the motor holds `motor_rad`, confirmed.
    fn enable(&self, bus: &mut Exchange, index: usize, motor_rad: f64) -> Result<(), BusError>;

    /// Asks one motor how it is; `status` is what it reported last.
    fn examine(
        &self,
        _bus: &mut Exchange,
        _index: usize,
        status: &Status,
    ) -> Result<Health, BusError> {
        Ok(Health {
            temperature_c: status.temperature_c,
            ..Health::default()
        })
    }

    /// Frames that turn one motor's torque off, to be sent without waiting.
    fn stop(&self, servo: &Servo, out: &mut Vec<CanFrame>);

    /// Frames that tell one motor where to be and make it report; `status` is
    /// what it reported last.
    fn command(&self, servo: &Servo, joint_rad: f64, status: &Status, out: &mut Vec<CanFrame>);

    /// Frames that end a cycle's commands.
    fn conclude(&self, _out: &mut Vec<CanFrame>) {}

    /// Takes in what any motor says. The index of a motor that reported its
    /// position with this frame.
    fn hear(&self, servos: &[Servo], frame: &CanFrame, status: &mut [Status]) -> Option<usize>;
}
