//! The CAN motors that this crate can drive. They speak radians, over the
//! ranges of their [`MotorModel`].

use std::f64::consts::TAU;

use crate::bus::kind::BusKind;
use crate::can::MotorModel;
use crate::servo::model::{DataSheet, ServoModel};

const fn motor(name: &'static str, kind: BusKind, motor: MotorModel) -> ServoModel {
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

/// A motor in MIT mode that cannot tell its ranges: CubeMars.
const fn cubemars(name: &'static str, velocity_rad_s: f64, torque_nm: f64) -> ServoModel {
    let ranges = MotorModel {
        position_rad: 12.5,
        velocity_rad_s,
        torque_nm,
        kp_max: 500.0,
        kd_max: 5.0,
        has_registers: false,
    };
    motor(name, BusKind::Mit, ranges)
}

/// A motor in MIT mode with registers: Damiao.
const fn damiao(name: &'static str, velocity_rad_s: f64, torque_nm: f64) -> ServoModel {
    let ranges = MotorModel {
        position_rad: 12.5,
        velocity_rad_s,
        torque_nm,
        kp_max: 500.0,
        kd_max: 5.0,
        has_registers: true,
    };
    motor(name, BusKind::Mit, ranges)
}

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
    };
    motor(name, BusKind::Robstride, ranges)
}

/// A drive whose protocol sends plain numbers: the ranges are what a robot
/// file may ask for, the torque is to be set there.
const fn drive(name: &'static str, kind: BusKind) -> ServoModel {
    let ranges = MotorModel {
        position_rad: 100.0,
        velocity_rad_s: 100.0,
        torque_nm: 10.0,
        kp_max: 5000.0,
        kd_max: 100.0,
        has_registers: true,
    };
    motor(name, kind, ranges)
}

/// Every CAN motor, family by family.
pub(crate) static CAN_MODELS: &[ServoModel] = &[
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
    robstride("RS00", 33.0, 14.0, 500.0, 5.0),
    robstride("RS01", 44.0, 17.0, 500.0, 5.0),
    robstride("RS02", 44.0, 17.0, 500.0, 5.0),
    robstride("RS03", 20.0, 60.0, 5000.0, 100.0),
    robstride("RS04", 15.0, 120.0, 5000.0, 100.0),
    drive("ODrive", BusKind::Odrive),
    drive("CiA402", BusKind::Cia402),
];
