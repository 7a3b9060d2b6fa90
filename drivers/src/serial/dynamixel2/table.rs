//! What the registers of the X series mean, and of MX with Protocol 2.0: names, ranges and
//! units as the vendor's manual has them. Ranges are the widest of all models; a servo
//! refuses what is out of its own.

use crate::serial::dynamixel2::models::BAUDS;
use crate::serial::dynamixel2::registers::*;
use crate::serial::family::prelude::*;

const VOLTS: Measure = Measure::Scaled(0.1, "V");
const CELSIUS: Measure = Measure::Scaled(1.0, "C");
/// Full scale of the PWM registers is 885.
const PWM: Measure = Measure::Scaled(100.0 / 885.0, "%");
/// 214.577 revolutions a minute, each minute.
const ACCELERATION: Measure = Measure::Scaled(214.577 * 360.0 / 3600.0, "deg/s2");
const TORQUE_WORDS: Measure = Measure::Choice(&[(0, "off"), (1, "on")]);
const MODES: Measure = Measure::Choice(&[
    (0, "current"),
    (1, "velocity"),
    (3, "position"),
    (4, "extended position"),
    (5, "current-based position"),
    (16, "PWM"),
]);
const DRIVE_BITS: Measure =
    Measure::Flags(&[(0, "reverse"), (2, "time-based profile"), (3, "torque on by goal")]);
const ERRORS: Measure = Measure::Flags(&CONDITIONS);
const LAST_TICK: i64 = 4095;
const HIGHEST_GAIN: i64 = 16_383;
const HIGHEST_PROFILE: i64 = 32_767;
const TORQUE_BY_GOAL: i64 = 1 << 3;
const TORQUE_AT_START: i64 = 1;

fn baud_of(code: u8) -> u32 {
    BAUDS.get(usize::from(code)).copied().unwrap_or(0)
}

const ENTRIES: &[TableEntry] = &[
    TableEntry::read(MODEL),
    TableEntry::read(FIRMWARE),
    TableEntry::address(ID),
    TableEntry::address(BAUD).measured(Measure::Rate(baud_of)),
    TableEntry::eeprom(RETURN_DELAY, 0, 254).measured(Measure::Scaled(2.0, "us")),
    TableEntry::eeprom(DRIVE_MODE, 0, 13).measured(DRIVE_BITS).torque_bits(TORQUE_BY_GOAL),
    TableEntry::eeprom(OPERATING_MODE, 0, 16).measured(MODES),
    TableEntry::eeprom(SHADOW_ID, 0, 255),
    // With Protocol 1 it would not answer the question whether it has changed.
    TableEntry::read(PROTOCOL_TYPE),
    TableEntry::eeprom(HOMING_OFFSET, -1_044_479, 1_044_479).signed().measured(Measure::Turn),
    TableEntry::eeprom(MOVING_THRESHOLD, 0, 1023).measured(Measure::Speed),
    TableEntry::eeprom(TEMPERATURE_LIMIT, 0, 100).measured(CELSIUS),
    TableEntry::eeprom(MAX_VOLTAGE, 31, 300).measured(VOLTS),
    TableEntry::eeprom(MIN_VOLTAGE, 31, 300).measured(VOLTS),
    TableEntry::eeprom(PWM_LIMIT, 0, 885).measured(PWM),
    TableEntry::eeprom(CURRENT_LIMIT, 0, 2047).measured(Measure::Current),
    TableEntry::eeprom(ACCELERATION_LIMIT, 0, HIGHEST_PROFILE).measured(ACCELERATION),
    TableEntry::eeprom(VELOCITY_LIMIT, 0, 2047).measured(Measure::Speed),
    TableEntry::eeprom(MAX_POSITION, 0, LAST_TICK).measured(Measure::Angle),
    TableEntry::eeprom(MIN_POSITION, 0, LAST_TICK).measured(Measure::Angle),
    TableEntry::eeprom(STARTUP, 0, 3).torque_bits(TORQUE_AT_START),
    TableEntry::eeprom(SHUTDOWN, 0, 63).measured(ERRORS),
    TableEntry::ram(TORQUE, 0, 1).measured(TORQUE_WORDS).torque_bits(1),
    TableEntry::ram(LED, 0, 1),
    // Without answers nothing can be read back.
    TableEntry::ram(STATUS_RETURN_LEVEL, 2, 2),
    TableEntry::read(REGISTERED),
    TableEntry::read(HARDWARE_ERROR).measured(ERRORS),
    TableEntry::ram(VELOCITY_I, 0, HIGHEST_GAIN),
    TableEntry::ram(VELOCITY_P, 0, HIGHEST_GAIN),
    TableEntry::ram(POSITION_D, 0, HIGHEST_GAIN),
    TableEntry::ram(POSITION_I, 0, HIGHEST_GAIN),
    TableEntry::ram(POSITION_P, 0, HIGHEST_GAIN),
    TableEntry::ram(FEED_FORWARD_2, 0, HIGHEST_GAIN),
    TableEntry::ram(FEED_FORWARD_1, 0, HIGHEST_GAIN),
    TableEntry::ram(BUS_WATCHDOG, 0, 127).signed(),
    TableEntry::goal(GOAL_PWM).signed().measured(PWM),
    TableEntry::goal(GOAL_CURRENT).signed().measured(Measure::Current),
    TableEntry::goal(GOAL_VELOCITY).signed().measured(Measure::Speed),
    TableEntry::ram(PROFILE_ACCELERATION, 0, HIGHEST_PROFILE).measured(ACCELERATION),
    TableEntry::ram(PROFILE_VELOCITY, 0, HIGHEST_PROFILE).measured(Measure::Speed),
    TableEntry::goal(GOAL_POSITION).signed().measured(Measure::Angle),
    TableEntry::read(TICK_MS).measured(Measure::Scaled(1.0, "ms")),
    TableEntry::read(MOVING),
    TableEntry::read(MOVING_STATUS),
    TableEntry::read(PRESENT_PWM).signed().measured(PWM),
    TableEntry::read(PRESENT_CURRENT).signed().measured(Measure::Current),
    TableEntry::read(PRESENT_VELOCITY).signed().measured(Measure::Speed),
    TableEntry::read(PRESENT_POSITION).signed().measured(Measure::Angle),
    TableEntry::read(VELOCITY_TRAJECTORY).signed().measured(Measure::Speed),
    TableEntry::read(POSITION_TRAJECTORY).signed().measured(Measure::Angle),
    TableEntry::read(PRESENT_VOLTAGE).measured(VOLTS),
    TableEntry::read(PRESENT_TEMPERATURE).measured(CELSIUS),
    TableEntry::read(BACKUP_READY),
];

pub(super) fn table(model: &'static ServoModel) -> RegisterTable {
    let places = Places {
        goals: Some((MIN_POSITION, MAX_POSITION)),
        speed: Some(VELOCITY_LIMIT),
        offset: Some(HOMING_OFFSET),
    };
    RegisterTable::new(model.name, model.into(), TORQUE, places, &[ENTRIES])
}
