//! The models of CubeMars and Damiao, and of RobStride switched to MIT mode.

use std::f64::consts::TAU;

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
        tells_tenths: false,
        own_loops: false,
    };
    motor(name, BusKind::Mit, ranges)
}

/// The same motor driven in position-velocity mode.
const fn own_loops(name: &'static str, velocity_rad_s: f64, torque_nm: f64) -> ServoModel {
    let mut model = mit(name, velocity_rad_s, torque_nm, true);
    if let Some(motor) = &mut model.motor {
        motor.own_loops = true;
    }
    model
}

/// 11-bit frames have gains of 12 bits over ranges of their own.
const fn robstride(name: &'static str, velocity_rad_s: f64, torque_nm: f64) -> ServoModel {
    let ranges = MotorModel {
        position_rad: 2.0 * TAU,
        velocity_rad_s,
        torque_nm,
        kp_max: 500.0,
        kd_max: 5.0,
        has_registers: false,
        tells_tenths: true,
        own_loops: false,
    };
    motor(name, BusKind::Mit, ranges)
}

/// Damiao motors have registers; the others cannot tell their ranges.
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
    own_loops("DM-J4310(PV)", 30.0, 10.0),
    own_loops("DM-J4340(PV)", 10.0, 28.0),
    own_loops("DM-J6006(PV)", 45.0, 20.0),
    own_loops("DM-J8006(PV)", 45.0, 40.0),
    own_loops("DM-J8009(PV)", 45.0, 54.0),
    own_loops("DM-J10010L(PV)", 25.0, 200.0),
    robstride("RS00(MIT)", 33.0, 14.0),
    robstride("RS01(MIT)", 44.0, 17.0),
    robstride("RS02(MIT)", 44.0, 17.0),
    robstride("RS03(MIT)", 20.0, 60.0),
    robstride("RS04(MIT)", 15.0, 120.0),
];
