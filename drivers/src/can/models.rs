//! What the models of CAN motors share. They speak radians over the ranges of their
//! [`MotorModel`]; the models stand in the folder of their family.

use std::f64::consts::TAU;

use crate::bus::kind::BusKind;
use crate::can::motor::MotorModel;
use crate::servo::model::{DataSheet, ServoModel};

pub(crate) const fn motor(name: &'static str, kind: BusKind, motor: MotorModel) -> ServoModel {
    ServoModel {
        name,
        number: 0,
        current_a_per_unit: None,
        velocity_rad_s_per_unit: 1.0,
        fast_read_firmware: u8::MAX,
        rad_per_tick: TAU / 4096.0,
        last_tick: 4095,
        bulk_read: false,
        kind,
        sheet: DataSheet::new(0.0, 0.0, 0.0, 0.0),
        motor: Some(motor),
    }
}

/// A drive whose protocol sends plain numbers: the ranges are what a robot
/// file may ask for, the torque is to be set there.
pub(crate) const fn drive(name: &'static str, kind: BusKind) -> ServoModel {
    let ranges = MotorModel {
        position_rad: 100.0,
        velocity_rad_s: 100.0,
        torque_nm: 10.0,
        kp_max: 5000.0,
        kd_max: 100.0,
        has_registers: true,
        tells_tenths: false,
        own_loops: false,
    };
    motor(name, kind, ranges)
}
