//! The models of the X series, and MX with Protocol 2.0. From the vendor's
//! control tables and manuals.

use std::f64::consts::TAU;

use crate::bus::kind::BusKind;
use crate::servo::model::{DataSheet, ServoModel};

/// The rates, in the order of the baud register's values.
pub static BAUDS: [u32; 8] = [
    9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000,
];

/// No firmware of these answers Fast Sync Read.
const NEVER: u8 = u8::MAX;

const fn model(
    name: &'static str,
    number: u16,
    current_a_per_unit: Option<f64>,
    fast_read_firmware: u8,
    sheet: DataSheet,
) -> ServoModel {
    ServoModel {
        name,
        number,
        current_a_per_unit,
        velocity_rad_s_per_unit: 0.229 * TAU / 60.0,
        fast_read_firmware,
        rad_per_tick: TAU / 4096.0,
        last_tick: 4095,
        bulk_read: true,
        kind: BusKind::Dynamixel2,
        sheet,
        motor: None,
    }
}

const fn with_play(sheet: DataSheet) -> DataSheet {
    DataSheet {
        backlash_arcmin: 15.0,
        ..sheet
    }
}

/// Name, number, amperes a unit of current, first firmware with Fast Sync Read, data sheet.
pub(super) static MODELS: &[ServoModel] = &[
    model(
        "MX-28",
        30,
        None,
        NEVER,
        DataSheet::new(2.5, 55.0, 1.4, 12.0),
    ),
    model(
        "MX-64",
        311,
        Some(3.36e-3),
        NEVER,
        DataSheet::new(6.0, 63.0, 4.1, 12.0),
    ),
    model(
        "MX-106",
        321,
        Some(3.36e-3),
        NEVER,
        DataSheet::new(8.4, 45.0, 5.2, 12.0),
    ),
    model(
        "XH430-W350",
        1000,
        Some(2.69e-3),
        45,
        DataSheet::new(3.4, 30.0, 1.3, 12.0),
    ),
    model(
        "XH430-W210",
        1010,
        Some(2.69e-3),
        45,
        DataSheet::new(2.5, 50.0, 1.3, 12.0),
    ),
    model(
        "XM430-W350",
        1020,
        Some(2.69e-3),
        45,
        with_play(DataSheet::new(4.1, 46.0, 2.3, 12.0)),
    ),
    model(
        "XM430-W210",
        1030,
        Some(2.69e-3),
        45,
        with_play(DataSheet::new(3.0, 77.0, 2.3, 12.0)),
    ),
    model(
        "XL430-W250",
        1060,
        None,
        45,
        DataSheet::new(1.5, 61.0, 1.4, 12.0),
    ),
    model(
        "XC430-W150",
        1070,
        None,
        45,
        DataSheet::new(1.6, 106.0, 1.4, 12.0),
    ),
    model(
        "XH540-W270",
        1100,
        Some(2.69e-3),
        45,
        with_play(DataSheet::new(9.9, 39.0, 4.9, 12.0)),
    ),
    model(
        "XM540-W270",
        1120,
        Some(2.69e-3),
        45,
        with_play(DataSheet::new(10.6, 30.0, 4.4, 12.0)),
    ),
    model(
        "XL330-M077",
        1190,
        Some(1e-3),
        46,
        DataSheet::new(0.215, 383.0, 1.47, 5.0),
    ),
    model(
        "XL330-M288",
        1200,
        Some(1e-3),
        46,
        DataSheet::new(0.52, 103.0, 1.47, 5.0),
    ),
    model(
        "XC330-T181",
        1210,
        Some(1e-3),
        46,
        DataSheet::new(0.76, 104.0, 0.8, 12.0),
    ),
    model(
        "XC330-T288",
        1220,
        Some(1e-3),
        46,
        DataSheet::new(0.95, 69.0, 0.8, 12.0),
    ),
    model(
        "XC330-M181",
        1230,
        Some(1e-3),
        46,
        DataSheet::new(0.6, 129.0, 1.8, 5.0),
    ),
    model(
        "XC330-M288",
        1240,
        Some(1e-3),
        46,
        DataSheet::new(0.93, 81.0, 1.8, 5.0),
    ),
];
