//! The models of CubeMars and Damiao. Both share the ranges of position and gains.

use crate::can::family::prelude::*;

const fn mit(
    name: &'static str,
    velocity_rad_s: f64,
    torque_nm: f64,
    has_registers: bool,
) -> ServoModel {
    let ranges = MotorModel {
        position_rad: 12.5,
        velocity_rad_s,
        torque_nm,
        kp_max: 500.0,
        kd_max: 5.0,
        has_registers,
    };
    motor(name, BusKind::Mit, ranges)
}

/// Damiao motors have registers; a CubeMars motor cannot tell its ranges.
pub(super) static MODELS: &[ServoModel] = &[
    mit("AK60-6", 50.0, 15.0, false),
    mit("AK70-10", 50.0, 25.0, false),
    mit("AK80-6", 76.0, 12.0, false),
    mit("AK80-9", 50.0, 18.0, false),
    mit("AK80-64", 8.0, 144.0, false),
    mit("AK10-9", 50.0, 65.0, false),
    mit("DM-J4310", 30.0, 10.0, true),
    mit("DM-J4340", 10.0, 28.0, true),
    mit("DM-J6006", 45.0, 20.0, true),
    mit("DM-J8006", 45.0, 40.0, true),
    mit("DM-J8009", 45.0, 54.0, true),
    mit("DM-J10010L", 25.0, 200.0, true),
];
