//! What the registers of AX servos mean, and of MX with Protocol 1.0: ranges and units as
//! the vendor's manuals have them.

use crate::serial::dynamixel1::registers::*;
use crate::serial::family::prelude::*;

const VOLTS: Measure = Measure::Scaled(0.1, "V");
const CELSIUS: Measure = Measure::Scaled(1.0, "C");
/// Full scale of torques and loads is 1023.
const SHARE: Measure = Measure::Scaled(100.0 / 1023.0, "%");
const ERRORS: Measure = Measure::Flags(&CONDITIONS);

const COMMON: &[TableEntry] = &[
    TableEntry::read(MODEL),
    TableEntry::read(FIRMWARE),
    TableEntry::address(ID),
    TableEntry::address(BAUD).measured(Measure::Rate(baud_of)),
    TableEntry::eeprom(RETURN_DELAY, 0, 254).measured(Measure::Scaled(2.0, "us")),
    TableEntry::eeprom(HOTTEST, 0, 100).measured(CELSIUS),
    TableEntry::eeprom(MIN_VOLTAGE, 50, 250).measured(VOLTS),
    TableEntry::eeprom(MAX_VOLTAGE, 50, 250).measured(VOLTS),
    TableEntry::eeprom(MAX_TORQUE, 0, 1023).measured(SHARE),
    // Without answers nothing can be read back.
    TableEntry::eeprom(STATUS_LEVEL, 2, 2),
    TableEntry::eeprom(ALARM_LED, 0, 127).measured(ERRORS),
    TableEntry::eeprom(SHUTDOWN, 0, 127).measured(ERRORS),
    TableEntry::ram(TORQUE, 0, 1)
        .measured(Measure::Choice(&[(0, "off"), (1, "on")]))
        .torque_bits(1),
    TableEntry::ram(LED, 0, 1),
    TableEntry::goal(GOAL).measured(Measure::Angle),
    TableEntry::ram(SPEED, 0, 1023).measured(Measure::Speed),
    TableEntry::ram(TORQUE_LIMIT, 0, 1023).measured(SHARE),
    TableEntry::read(POSITION).measured(Measure::Angle),
    TableEntry::read(PRESENT_SPEED).sign_bit(SIGN_BIT).measured(Measure::Speed),
    TableEntry::read(LOAD).sign_bit(SIGN_BIT).measured(SHARE),
    TableEntry::read(VOLTAGE).measured(VOLTS),
    TableEntry::read(TEMPERATURE).measured(CELSIUS),
    TableEntry::read(REGISTERED),
    TableEntry::read(MOVING),
    // Set, nothing permanent can be written until the servo is switched off.
    TableEntry::read(LOCK),
    TableEntry::ram(PUNCH, 0, 1023),
];

const AX_ONLY: &[TableEntry] = &[
    TableEntry::eeprom(LOWEST, 0, 1023).measured(Measure::Angle),
    TableEntry::eeprom(HIGHEST, 0, 1023).measured(Measure::Angle),
    TableEntry::ram(CW_MARGIN, 0, 255),
    TableEntry::ram(CCW_MARGIN, 0, 255),
    TableEntry::ram(CW_SLOPE, 0, 254),
    TableEntry::ram(CCW_SLOPE, 0, 254),
];

const MX_ONLY: &[TableEntry] = &[
    TableEntry::eeprom(LOWEST, 0, 4095).measured(Measure::Angle),
    TableEntry::eeprom(HIGHEST, 0, 4095).measured(Measure::Angle),
    TableEntry::ram(D_GAIN, 0, 254),
    TableEntry::ram(I_GAIN, 0, 254),
    TableEntry::ram(P_GAIN, 0, 254),
    // Set, the servo drives by torque, whatever its goal.
    TableEntry::ram(TORQUE_MODE, 0, 0),
    TableEntry::ram(ACCELERATION, 0, 254).measured(Measure::Scaled(8.583, "deg/s2")),
];

pub(super) fn table(model: &'static ServoModel) -> RegisterTable {
    let places = Places { goals: Some((LOWEST, HIGHEST)), ..Places::default() };
    let parts: &'static [&'static [TableEntry]] = match model.bulk_read {
        true => &[COMMON, MX_ONLY],
        false => &[COMMON, AX_ONLY],
    };
    RegisterTable::new(model.name, model.into(), TORQUE, places, parts)
}
