//! The models of CubeMars and Damiao. Both share the ranges of position and gains.

use crate::bus::kind::BusKind;
use crate::can::models::motor;
use crate::can::motor::MotorModel;
use crate::servo::model::ServoModel;

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

/// CubeMars: without registers a motor cannot tell its ranges.
const fn cubemars(name: &'static str, velocity_rad_s: f64, torque_nm: f64) -> ServoModel {
    mit(name, velocity_rad_s, torque_nm, false)
}

const fn damiao(name: &'static str, velocity_rad_s: f64, torque_nm: f64) -> ServoModel {
    mit(name, velocity_rad_s, torque_nm, true)
}

pub(super) static MODELS: &[ServoModel] = &[
    cubemars("AK60-6", 50.0, 15.0),
    cubemars("AK70-10", 50.0, 25.0),
    cubemars("AK80-6", 76.0, 12.0),
    cubemars("AK80-9", 50.0, 18.0),
    cubemars("AK80-64", 8.0, 144.0),
    cubemars("AK10-9", 50.0, 65.0),
    damiao("DM-J4310", 30.0, 10.0),
    damiao("DM-J4340", 10.0, 28.0),
    damiao("DM-J6006", 45.0, 20.0),
    damiao("DM-J8006", 45.0, 40.0),
    damiao("DM-J8009", 45.0, 54.0),
    damiao("DM-J10010L", 25.0, 200.0),
];
