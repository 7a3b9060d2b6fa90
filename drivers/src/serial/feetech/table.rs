//! What the registers of Feetech STS servos mean: ranges and units as the vendor's tables
//! have them.

use crate::serial::family::prelude::*;
use crate::serial::feetech::registers::*;

const VOLTS: Measure = Measure::Scaled(0.1, "V");
const CELSIUS: Measure = Measure::Scaled(1.0, "C");
/// Torques and loads are in thousandths, some in hundredths.
const PER_MILLE: Measure = Measure::Scaled(0.1, "%");
const PERCENT: Measure = Measure::Scaled(1.0, "%");
const ERRORS: Measure = Measure::Flags(&CONDITIONS);
/// A hundred ticks a second, each second.
const ACCELERATION_UNIT: Measure = Measure::Scaled(100.0 * 360.0 / 4096.0, "deg/s2");
const LOAD_SIGN_BIT: u32 = 10;

const ENTRIES: &[TableEntry] = &[
    TableEntry::read(FIRMWARE),
    TableEntry::read(MODEL),
    TableEntry::address(ID),
    TableEntry::address(BAUD).measured(Measure::Rate(baud_of)),
    TableEntry::eeprom(RETURN_DELAY, 0, 254).measured(Measure::Scaled(2.0, "us")),
    // Without answers nothing can be read back.
    TableEntry::eeprom(STATUS_LEVEL, 1, 1),
    TableEntry::eeprom(LOWEST, 0, 4095).measured(Measure::Angle),
    TableEntry::eeprom(HIGHEST, 0, 4095).measured(Measure::Angle),
    TableEntry::eeprom(HOTTEST, 0, 100).measured(CELSIUS),
    TableEntry::eeprom(MAX_VOLTAGE, 0, 254).measured(VOLTS),
    TableEntry::eeprom(MIN_VOLTAGE, 0, 254).measured(VOLTS),
    TableEntry::eeprom(MAX_TORQUE, 0, 1000).measured(PER_MILLE),
    TableEntry::eeprom(PHASE, 0, 254),
    TableEntry::eeprom(UNLOADING, 0, 254).measured(ERRORS),
    TableEntry::eeprom(ALARM_LED, 0, 254).measured(ERRORS),
    TableEntry::eeprom(P_GAIN, 0, 254),
    TableEntry::eeprom(D_GAIN, 0, 254),
    TableEntry::eeprom(I_GAIN, 0, 254),
    TableEntry::eeprom(STARTUP_FORCE, 0, 1000).measured(PER_MILLE),
    TableEntry::eeprom(CW_DEAD_ZONE, 0, 32),
    TableEntry::eeprom(CCW_DEAD_ZONE, 0, 32),
    TableEntry::eeprom(CURRENT_PROTECTION, 0, 511).measured(Measure::Current),
    TableEntry::eeprom(RESOLUTION, 0, 3),
    TableEntry::eeprom(OFFSET, -2047, 2047).sign_bit(OFFSET_SIGN_BIT).measured(Measure::Turn),
    TableEntry::eeprom(MODE, 0, 3).measured(Measure::Choice(&[
        (0, "position"),
        (1, "speed"),
        (2, "PWM"),
        (3, "steps"),
    ])),
    TableEntry::eeprom(PROTECTIVE_TORQUE, 0, 100).measured(PERCENT),
    TableEntry::eeprom(PROTECTION_TIME, 0, 254).measured(Measure::Scaled(10.0, "ms")),
    TableEntry::eeprom(OVERLOAD_TORQUE, 0, 100).measured(PERCENT),
    TableEntry::eeprom(SPEED_P, 0, 254),
    TableEntry::eeprom(OVERCURRENT_TIME, 0, 254).measured(Measure::Scaled(10.0, "ms")),
    TableEntry::eeprom(SPEED_I, 0, 254),
    TableEntry::ram(TORQUE, 0, 1)
        .measured(Measure::Choice(&[(0, "off"), (1, "on")]))
        .torque_bits(1),
    TableEntry::ram(ACCELERATION, 0, 254).measured(ACCELERATION_UNIT),
    TableEntry::goal(GOAL).sign_bit(SIGN_BIT).measured(Measure::Angle),
    TableEntry::goal(GOAL_TIME),
    TableEntry::goal(GOAL_SPEED).sign_bit(SIGN_BIT).measured(Measure::Speed),
    TableEntry::ram(TORQUE_LIMIT, 0, 1000).measured(PER_MILLE),
    // Opened before permanent memory is written, and closed behind it.
    TableEntry::read(LOCK),
    TableEntry::read(POSITION).sign_bit(SIGN_BIT).measured(Measure::Angle),
    TableEntry::read(SPEED).sign_bit(SIGN_BIT).measured(Measure::Speed),
    TableEntry::read(LOAD).sign_bit(LOAD_SIGN_BIT).measured(PER_MILLE),
    TableEntry::read(VOLTAGE).measured(VOLTS),
    TableEntry::read(TEMPERATURE).measured(CELSIUS),
    TableEntry::read(STATUS).measured(ERRORS),
    TableEntry::read(MOVING),
    TableEntry::read(CURRENT).sign_bit(SIGN_BIT).measured(Measure::Current),
];

pub(super) fn table(model: &'static ServoModel) -> RegisterTable {
    let places = Places { goals: Some((LOWEST, HIGHEST)), speed: None, offset: Some(OFFSET) };
    RegisterTable::new(model.name, model.into(), TORQUE, places, &[ENTRIES])
}
