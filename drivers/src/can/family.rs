//! A family of CAN motors: what each adds to [`crate::can::CanBus`], and the list of them.
//!
//! A family is one folder: its registers, framing, driver and scan. A new one gets a
//! variant of [`BusKind`]; the compiler then asks for its line in [`of_kind`] and in the
//! simulator.

use std::io;

use crate::bus::Health;
use crate::can::cia402::Cia402;
use crate::can::cycle_frames::CycleFrames;
use crate::can::exchange::{CanExchange, MotorStatus};
use crate::can::mit::Mit;
use crate::can::odrive::Odrive;
use crate::can::robstride::Robstride;
use crate::can::scan::inquiry::{CanFound, ScanLink};
use crate::can::transport::CanFrame;
use crate::config::BusKind;
use crate::error::BusError;
use crate::servo::Servo;

/// The protocol of a family of motors.
pub(crate) trait CanFamily: Send + Sync {
    /// The frames of one control cycle, for the rate that a bus carries.
    fn cycle_frames(&self) -> CycleFrames;

    /// Turns one motor's torque off and reads its position and faults. The motor
    /// confirms both; one that cannot say whether it drives confirms by answering.
    fn torque_off(&self, bus: &mut CanExchange, index: usize) -> Result<MotorStatus, BusError>;

    /// Checks and sets up one motor whose torque is off: model, ranges, modes,
    /// limits, watchdog, each read back. Notes are for the user.
    fn set_up(
        &self,
        bus: &mut CanExchange,
        index: usize,
        notes: &mut Vec<String>,
    ) -> Result<(), BusError>;

    /// Turns torque on so that the motor holds `motor_rad`, confirmed.
    fn torque_on(
        &self,
        bus: &mut CanExchange,
        index: usize,
        motor_rad: f64,
    ) -> Result<(), BusError>;

    /// Reads the health of one motor; `status` is its last report.
    fn read_health(
        &self,
        _bus: &mut CanExchange,
        _index: usize,
        status: &MotorStatus,
    ) -> Result<Health, BusError> {
        Ok(Health {
            temperature_c: status.temperature_c,
            ..Health::default()
        })
    }

    /// Frames that turn one motor's torque off, to be sent without waiting.
    fn torque_off_frames(&self, servo: &Servo, out: &mut Vec<CanFrame>);

    /// Frames that send one motor its target and make it report; `status` is its
    /// last report.
    fn target_frames(
        &self,
        servo: &Servo,
        joint_rad: f64,
        status: &MotorStatus,
        out: &mut Vec<CanFrame>,
    );

    /// Frames that end a cycle's targets.
    fn cycle_end_frames(&self, _out: &mut Vec<CanFrame>) {}

    /// Updates `status` from a frame of any motor. The index of a motor that
    /// reported its position with this frame.
    fn parse_frame(
        &self,
        servos: &[Servo],
        frame: &CanFrame,
        status: &mut [MotorStatus],
    ) -> Option<usize>;

    /// The motors of this family that were heard or that answer, by id. Frames with
    /// 11-bit ids are sent only if `may_send_standard`.
    fn scan(
        &self,
        scanner: &mut ScanLink,
        heard: &[CanFrame],
        may_send_standard: bool,
    ) -> io::Result<Vec<CanFound>>;
}

/// The family that a bus speaks; `None` for a serial bus.
pub(crate) fn of_kind(kind: BusKind) -> Option<&'static dyn CanFamily> {
    Some(match kind {
        BusKind::Mit => &Mit,
        BusKind::Robstride => &Robstride,
        BusKind::Odrive => &Odrive,
        BusKind::Cia402 => &Cia402,
        BusKind::Dynamixel2 | BusKind::Dynamixel1 | BusKind::Feetech => return None,
    })
}
