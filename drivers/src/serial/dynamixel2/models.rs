//! The models of the X series, and MX with Protocol 2.0. From the vendor's
//! control tables and manuals.

use std::f64::consts::TAU;

use crate::bus::kind::BusKind;
use crate::servo::model::{DataSheet, ServoModel};

/// The rates, in the order of the baud register's values.
pub static BAUDS: [u32; 8] =
    [9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000];

const NEVER: u8 = u8::MAX;
/// Amperes a unit of current of the XM and XH models.
const XM_A: f64 = 2.69e-3;

/// Name, number, amperes a unit of current (0 without a sensor), first firmware with Fast Sync
/// Read; stall torque (Nm), no-load speed (rpm), stall current (A) at a supply (V), play (arcmin).
type Row = (&'static str, u16, f64, u8, [f64; 5]);

const ROWS: [Row; 17] = [
    ("MX-28", 30, 0.0, NEVER, [2.5, 55.0, 1.4, 12.0, 0.0]),
    ("MX-64", 311, 3.36e-3, NEVER, [6.0, 63.0, 4.1, 12.0, 0.0]),
    ("MX-106", 321, 3.36e-3, NEVER, [8.4, 45.0, 5.2, 12.0, 0.0]),
    ("XH430-W350", 1000, XM_A, 45, [3.4, 30.0, 1.3, 12.0, 0.0]),
    ("XH430-W210", 1010, XM_A, 45, [2.5, 50.0, 1.3, 12.0, 0.0]),
    ("XM430-W350", 1020, XM_A, 45, [4.1, 46.0, 2.3, 12.0, 15.0]),
    ("XM430-W210", 1030, XM_A, 45, [3.0, 77.0, 2.3, 12.0, 15.0]),
    ("XL430-W250", 1060, 0.0, 45, [1.5, 61.0, 1.4, 12.0, 0.0]),
    ("XC430-W150", 1070, 0.0, 45, [1.6, 106.0, 1.4, 12.0, 0.0]),
    ("XH540-W270", 1100, XM_A, 45, [9.9, 39.0, 4.9, 12.0, 15.0]),
    ("XM540-W270", 1120, XM_A, 45, [10.6, 30.0, 4.4, 12.0, 15.0]),
    ("XL330-M077", 1190, 1e-3, 46, [0.215, 383.0, 1.47, 5.0, 0.0]),
    ("XL330-M288", 1200, 1e-3, 46, [0.52, 103.0, 1.47, 5.0, 0.0]),
    ("XC330-T181", 1210, 1e-3, 46, [0.76, 104.0, 0.8, 12.0, 0.0]),
    ("XC330-T288", 1220, 1e-3, 46, [0.95, 69.0, 0.8, 12.0, 0.0]),
    ("XC330-M181", 1230, 1e-3, 46, [0.6, 129.0, 1.8, 5.0, 0.0]),
    ("XC330-M288", 1240, 1e-3, 46, [0.93, 81.0, 1.8, 5.0, 0.0]),
];

const fn model((name, number, current_a, fast_read_firmware, sheet): Row) -> ServoModel {
    let [torque_nm, rpm, stall_a, voltage_v, backlash_arcmin] = sheet;
    ServoModel {
        name,
        number,
        current_a_per_unit: if current_a > 0.0 { Some(current_a) } else { None },
        velocity_rad_s_per_unit: 0.229 * TAU / 60.0,
        fast_read_firmware,
        rad_per_tick: TAU / 4096.0,
        last_tick: 4095,
        bulk_read: true,
        kind: BusKind::Dynamixel2,
        sheet: DataSheet { backlash_arcmin, ..DataSheet::new(torque_nm, rpm, stall_a, voltage_v) },
        motor: None,
    }
}

pub(super) static MODELS: &[ServoModel] = &{
    let mut models = [const { model(ROWS[0]) }; ROWS.len()];
    let mut place = 1;
    while place < ROWS.len() {
        models[place] = model(ROWS[place]);
        place += 1;
    }
    models
};
