//! What the servo models are: numbers, units, encoder or ranges.
//!
//! From the vendors' control tables and manuals. A turn is 4096 ticks for every
//! serial servo listed but AX (300 degrees in 1024); the units of velocity and current differ, and some
//! models report load instead of current. CAN motors speak radians, over the
//! ranges of their [`MotorModel`].

use std::f64::consts::TAU;

use crate::can::MotorModel;
use crate::config::BusKind;

/// A turn in 4096 ticks.
const TICK_RAD: f64 = TAU / 4096.0;
/// 300 degrees in 1024 ticks.
const AX_TICK_RAD: f64 = TAU * 300.0 / 360.0 / 1024.0;

/// One servo model.
#[derive(Debug, PartialEq)]
pub struct Model {
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
    /// Whether it answers a Bulk Read; of Protocol 1 servos only MX do.
    pub bulk_read: bool,
    /// The protocol it speaks.
    pub kind: BusKind,
    /// What the numbers of a CAN motor mean; `None` for a serial servo.
    pub motor: Option<MotorModel>,
}

impl Model {
    /// The highest position of a serial servo, ticks.
    pub fn last_tick(&self) -> f64 {
        if self.rad_per_tick == AX_TICK_RAD {
            1023.0
        } else {
            4095.0
        }
    }

    /// The model with this name; a connector suffix (`-T`, `-R`) is ignored.
    pub fn from_name(name: &str) -> Option<&'static Model> {
        let bare = name
            .strip_suffix("-T")
            .or_else(|| name.strip_suffix("-R"))
            .unwrap_or(name);
        MODELS.iter().find(|model| model.name == bare)
    }

    /// The model with this number.
    pub fn from_number(number: u16) -> Option<&'static Model> {
        MODELS.iter().find(|model| model.number == number)
    }
}

const fn model(
    name: &'static str,
    number: u16,
    current_a_per_unit: Option<f64>,
    fast_read_firmware: u8,
) -> Model {
    Model {
        name,
        number,
        current_a_per_unit,
        velocity_rad_s_per_unit: 0.229 * TAU / 60.0,
        fast_read_firmware,
        rad_per_tick: TICK_RAD,
        bulk_read: true,
        kind: BusKind::Dynamixel2,
        motor: None,
    }
}

/// AX of Protocol 1: 1024 ticks over 300 degrees, no current, no Bulk Read.
const fn ax(name: &'static str, number: u16) -> Model {
    Model {
        current_a_per_unit: None,
        velocity_rad_s_per_unit: 0.111 * TAU / 60.0,
        rad_per_tick: AX_TICK_RAD,
        bulk_read: false,
        kind: BusKind::Dynamixel1,
        ..model(name, number, None, u8::MAX)
    }
}

/// MX with Protocol 1: 4096 ticks a turn, Bulk Read.
const fn mx1(name: &'static str, number: u16) -> Model {
    Model {
        velocity_rad_s_per_unit: 0.114 * TAU / 60.0,
        kind: BusKind::Dynamixel1,
        ..model(name, number, None, u8::MAX)
    }
}

/// Feetech STS: a tick a second in one unit of velocity, 6.5 mA in one of current.
const fn feetech(name: &'static str, number: u16) -> Model {
    Model {
        name,
        number,
        current_a_per_unit: Some(6.5e-3),
        velocity_rad_s_per_unit: TICK_RAD,
        fast_read_firmware: u8::MAX,
        rad_per_tick: TICK_RAD,
        bulk_read: false,
        kind: BusKind::Feetech,
        motor: None,
    }
}

/// A CAN motor.
const fn motor(name: &'static str, kind: BusKind, motor: MotorModel) -> Model {
    Model {
        name,
        number: 0,
        current_a_per_unit: None,
        velocity_rad_s_per_unit: 1.0,
        fast_read_firmware: u8::MAX,
        rad_per_tick: TICK_RAD,
        bulk_read: false,
        kind,
        motor: Some(motor),
    }
}

/// A motor in MIT mode that cannot tell its ranges: CubeMars.
const fn cubemars(name: &'static str, velocity_rad_s: f64, torque_nm: f64) -> Model {
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
const fn damiao(name: &'static str, velocity_rad_s: f64, torque_nm: f64) -> Model {
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
) -> Model {
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
const fn drive(name: &'static str, kind: BusKind) -> Model {
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

/// Every model this crate can drive.
pub const MODELS: &[Model] = &[
    ax("AX-12A", 12),
    ax("AX-18A", 18),
    mx1("MX-28(1.0)", 29),
    mx1("MX-64(1.0)", 310),
    mx1("MX-106(1.0)", 320),
    model("MX-28", 30, None, u8::MAX),
    model("MX-64", 311, Some(3.36e-3), u8::MAX),
    model("MX-106", 321, Some(3.36e-3), u8::MAX),
    model("XH430-W350", 1000, Some(2.69e-3), 45),
    model("XH430-W210", 1010, Some(2.69e-3), 45),
    model("XM430-W350", 1020, Some(2.69e-3), 45),
    model("XM430-W210", 1030, Some(2.69e-3), 45),
    model("XL430-W250", 1060, None, 45),
    model("XC430-W150", 1070, None, 45),
    model("XH540-W270", 1100, Some(2.69e-3), 45),
    model("XM540-W270", 1120, Some(2.69e-3), 45),
    model("XL330-M077", 1190, Some(1e-3), 46),
    model("XL330-M288", 1200, Some(1e-3), 46),
    model("XC330-T181", 1210, Some(1e-3), 46),
    model("XC330-T288", 1220, Some(1e-3), 46),
    model("XC330-M181", 1230, Some(1e-3), 46),
    model("XC330-M288", 1240, Some(1e-3), 46),
    feetech("STS3215", 777),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connector_suffix_is_ignored() {
        assert_eq!(Model::from_name("XM430-W350-R").unwrap().number, 1020);
        assert!(Model::from_name("XM430").is_none());
    }

    #[test]
    fn numbers_and_names_are_unique() {
        for (i, a) in MODELS.iter().enumerate() {
            for b in &MODELS[i + 1..] {
                let numbered = a.number != b.number || a.motor.is_some();
                assert!(numbered && a.name != b.name, "{}", a.name);
            }
        }
    }
}
