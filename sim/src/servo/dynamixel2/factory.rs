//! Factory settings of the X series and of MX with Protocol 2.0, by model number.

use servodance_drivers::ServoModel;

#[derive(Debug)]
pub(crate) struct FactorySettings {
    pub temperature_limit: i64,
    pub min_voltage: i64,
    pub max_voltage: i64,
    pub current_limit: i64,
    pub velocity_limit: i64,
    pub shutdown: i64,
    pub velocity_i: i64,
    pub velocity_p: i64,
    pub position_p: i64,
    pub top_baud_code: i64,
}

const X430: FactorySettings = FactorySettings {
    temperature_limit: 80,
    min_voltage: 95,
    max_voltage: 160,
    current_limit: 1193,
    velocity_limit: 350,
    shutdown: 52,
    velocity_i: 1920,
    velocity_p: 100,
    position_p: 800,
    top_baud_code: 7,
};

const X330: FactorySettings = FactorySettings {
    temperature_limit: 70,
    min_voltage: 35,
    max_voltage: 70,
    current_limit: 1750,
    velocity_limit: 445,
    shutdown: 53,
    velocity_i: 1600,
    velocity_p: 180,
    position_p: 400,
    top_baud_code: 6,
};

const MX: FactorySettings = FactorySettings { velocity_limit: 380, position_p: 850, ..X430 };

pub(super) fn factory_settings(model: &ServoModel) -> &'static FactorySettings {
    match model.number {
        0..1000 => &MX,
        1190..1210 | 1230..1250 => &X330,
        _ => &X430,
    }
}

/// Blocks of indirect addresses: first pointer, first data byte, count.
pub(super) fn indirect_blocks(model: &ServoModel) -> &'static [(u16, u16, u16)] {
    match model.number {
        1190..1250 => &[(168, 208, 20)],
        _ => &[(168, 224, 28), (578, 634, 28)],
    }
}
