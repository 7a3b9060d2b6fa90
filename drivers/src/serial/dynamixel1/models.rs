//! The models of Protocol 1.0. From the vendor's control tables and manuals.

use std::f64::consts::TAU;

use crate::bus::kind::BusKind;
use crate::servo::model::{DataSheet, ServoModel};

/// The rates of the baud register; an AX knows them up to 1 Mbps.
pub(super) static BAUDS: [u32; 13] = [
    9_600, 19_200, 57_600, 115_200, 200_000, 250_000, 400_000, 500_000, 1_000_000, 2_000_000,
    2_250_000, 2_500_000, 3_000_000,
];
pub(super) const AX_BAUDS: usize = 9;

/// MX: 4096 ticks a turn, Bulk Read.
const fn mx(name: &'static str, number: u16, sheet: DataSheet) -> ServoModel {
    ServoModel {
        name,
        number,
        current_a_per_unit: None,
        velocity_rad_s_per_unit: 0.114 * TAU / 60.0,
        fast_read_firmware: u8::MAX,
        rad_per_tick: TAU / 4096.0,
        last_tick: 4095,
        bulk_read: true,
        kind: BusKind::Dynamixel1,
        sheet,
        motor: None,
    }
}

/// AX: 1024 ticks over 300 degrees, no Bulk Read.
const fn ax(name: &'static str, number: u16, sheet: DataSheet) -> ServoModel {
    ServoModel {
        velocity_rad_s_per_unit: 0.111 * TAU / 60.0,
        rad_per_tick: TAU * 300.0 / 360.0 / 1024.0,
        last_tick: 1023,
        bulk_read: false,
        ..mx(name, number, sheet)
    }
}

pub(super) static MODELS: &[ServoModel] = &[
    ax("AX-12A", 12, DataSheet::new(1.5, 59.0, 1.5, 12.0)),
    ax("AX-18A", 18, DataSheet::new(1.8, 97.0, 2.2, 12.0)),
    mx("MX-28(1.0)", 29, DataSheet::new(2.5, 55.0, 1.4, 12.0)),
    mx("MX-64(1.0)", 310, DataSheet::new(6.0, 63.0, 4.1, 12.0)),
    mx("MX-106(1.0)", 320, DataSheet::new(8.4, 45.0, 5.2, 12.0)),
];
