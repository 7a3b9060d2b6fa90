//! The models of RobStride.

use std::f64::consts::TAU;

use crate::can::family::prelude::*;

const fn robstride(
    name: &'static str,
    velocity_rad_s: f64,
    torque_nm: f64,
    kp_max: f64,
    kd_max: f64,
) -> ServoModel {
    let ranges = MotorModel {
        position_rad: 2.0 * TAU,
        velocity_rad_s,
        torque_nm,
        kp_max,
        kd_max,
        has_registers: true,
        tells_tenths: false,
        own_loops: false,
    };
    motor(name, BusKind::Robstride, ranges)
}

pub(super) static MODELS: &[ServoModel] = &[
    robstride("RS00", 33.0, 14.0, 500.0, 5.0),
    robstride("RS01", 44.0, 17.0, 500.0, 5.0),
    robstride("RS02", 44.0, 17.0, 500.0, 5.0),
    robstride("RS03", 20.0, 60.0, 5000.0, 100.0),
    robstride("RS04", 15.0, 120.0, 5000.0, 100.0),
];
