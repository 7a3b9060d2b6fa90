//! What a family of CAN motors adds to [`crate::can::CanBus`].
//!
//! A family is one folder: its registers, framing, models, driver and scan. A new one
//! gets a variant of [`crate::BusKind`]; the compiler then asks for its line in
//! `families.rs` and in the simulator's `can/mod.rs`.

use std::io;

use self::prelude::*;

/// What the files of a family need of this crate.
pub(crate) mod prelude {
    pub(crate) use super::{CanFamily, IdSetting};
    pub(crate) use crate::bus::config::BusConfig;
    pub(crate) use crate::bus::kind::BusKind;
    pub(crate) use crate::bus::{Health, Notes};
    pub(crate) use crate::can::client::MotorClient;
    pub(crate) use crate::can::cycle_frames::CycleFrames;
    pub(crate) use crate::can::exchange::MotorStatus;
    pub(crate) use crate::can::models::{drive, motor};
    pub(crate) use crate::can::motor::{MotorModel, MotorSettings};
    pub(crate) use crate::can::rounding::whole_range;
    pub(crate) use crate::can::scan::inquiry::{CanFound, ScanLink};
    pub(crate) use crate::can::transport::{CanFrame, word};
    pub(crate) use crate::error::BusResult;
    pub(crate) use crate::servo::Servo;
    pub(crate) use crate::servo::model::ServoModel;
}

/// Who sets the ids of CAN motors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IdSetting {
    /// The vendor's own program alone.
    Vendor,
    /// This crate, one motor among others.
    OfOne,
    /// This crate; but every motor that hears it takes the new id.
    OfAll,
}

pub(crate) trait CanFamily: Send + Sync {
    fn models(&self) -> &'static [ServoModel];

    fn cycle_frames(&self) -> CycleFrames;

    /// Whether its frames are of CAN FD, which not every link carries.
    fn is_flexible(&self) -> bool {
        false
    }

    /// Turns one motor's torque off and reads its position and faults. The motor
    /// confirms both; one that cannot say whether it drives confirms by answering.
    fn torque_off(&self, client: &mut MotorClient) -> BusResult<MotorStatus>;

    /// Checks and sets up one motor whose torque is off: model, ranges, modes,
    /// limits, watchdog, each read back. Notes are for the user.
    fn set_up(&self, client: &mut MotorClient, notes: &mut Notes) -> BusResult<()>;

    /// Turns torque on so that the motor holds `motor_rad`, confirmed.
    fn torque_on(&self, client: &mut MotorClient, motor_rad: f64) -> BusResult<()>;

    /// Reads the health of one motor; `status` is its last report.
    fn read_health(&self, _client: &mut MotorClient, status: &MotorStatus) -> BusResult<Health> {
        Ok(Health { temperature_c: status.temperature_c, ..Health::default() })
    }

    /// Frames that turn one motor's torque off, to be sent without waiting.
    fn torque_off_frames(&self, servo: &Servo, out: &mut Vec<CanFrame>);

    /// Frames that send one motor its target and make it report; `status` is its last report.
    fn target_frames(
        &self,
        config: &BusConfig,
        servo: &Servo,
        joint_rad: f64,
        status: &MotorStatus,
        out: &mut Vec<CanFrame>,
    );

    fn cycle_end_frames(&self, _out: &mut Vec<CanFrame>) {}

    /// Asks one motor for what its reports do not tell: one motor a cycle, in turn.
    fn watch_frames(&self, _servo: &Servo, _out: &mut Vec<CanFrame>) {}

    /// Whether a motor whose time-out has passed goes on with the next command, and no report
    /// tells that it had stopped: then this side must know from its own silence.
    fn forgets_trips(&self) -> bool {
        false
    }

    /// Updates `status` from a frame of any motor. The index of a motor that
    /// reported its position with this frame.
    fn parse_frame(
        &self,
        servos: &[Servo],
        frame: &CanFrame,
        status: &mut [MotorStatus],
    ) -> Option<usize>;

    fn scan(&self, scanner: &mut ScanLink) -> io::Result<Vec<CanFound>>;

    /// Who sets the id of such a motor.
    fn id_setting(&self, _model: &ServoModel) -> IdSetting {
        IdSetting::Vendor
    }

    /// Frames that give the motor with id `from` the ids of `servo`, kept without power; `None`
    /// where that cannot be done here.
    fn id_frames(
        &self,
        _scanner: &mut ScanLink,
        _from: u8,
        _servo: &Servo,
    ) -> io::Result<Option<Vec<CanFrame>>> {
        Ok(None)
    }
}
