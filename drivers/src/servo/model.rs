//! What a servo model is: its number, the units of its registers, its data sheet.
//!
//! The models themselves stand in the folder of their family, and
//! [`ServoModel::all`] goes through them.

use crate::bus::kind::BusKind;
use crate::can::MotorModel;

/// What the vendor's data sheet says at the nominal voltage, rounded. The
/// simulated servos move by these figures; the drivers do not read them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DataSheet {
    /// Stall torque, newton metres.
    pub stall_torque_nm: f64,
    /// No-load speed, revolutions a minute.
    pub no_load_rpm: f64,
    /// The current at stall, amperes.
    pub stall_current_a: f64,
    /// The supply of these figures, volts.
    pub voltage_v: f64,
    /// Play of the gear, arc minutes; 0 where the vendor does not state one.
    pub backlash_arcmin: f64,
}

impl DataSheet {
    /// Stall torque (Nm), no-load speed (rpm), stall current (A) at a nominal supply (V).
    pub const fn new(torque_nm: f64, rpm: f64, current_a: f64, voltage_v: f64) -> Self {
        Self {
            stall_torque_nm: torque_nm,
            no_load_rpm: rpm,
            stall_current_a: current_a,
            voltage_v,
            backlash_arcmin: 0.0,
        }
    }
}

/// One model of a servo, serial or CAN.
#[derive(Debug, PartialEq)]
pub struct ServoModel {
    /// The vendor's name without the connector suffix, e.g. `XM430-W350`.
    pub name: &'static str,
    /// What a serial servo answers to a ping; 0 for CAN motors, which have no number.
    pub number: u16,
    /// Amperes a unit of the present-current register; `None` where the model
    /// has no current sensor (the register then holds a load estimate).
    pub current_a_per_unit: Option<f64>,
    /// Radians a second in one unit of velocity.
    pub velocity_rad_s_per_unit: f64,
    /// First firmware that answers Fast Sync Read.
    pub fast_read_firmware: u8,
    /// Radians in one tick of the encoder.
    pub rad_per_tick: f64,
    /// The highest position of a serial servo, ticks.
    pub last_tick: u16,
    /// Whether a servo of Protocol 1 answers a Bulk Read; only MX do.
    pub bulk_read: bool,
    /// The protocol that the model speaks.
    pub kind: BusKind,
    /// The data sheet of a serial servo.
    pub sheet: DataSheet,
    /// What the numbers of a CAN motor mean; `None` for a serial servo.
    pub motor: Option<MotorModel>,
}
