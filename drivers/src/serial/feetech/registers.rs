//! The memory of Feetech STS servos, as the vendor's tables have it.

#![allow(missing_docs)] // each register says its own name

use crate::serial::family::prelude::*;

const FIRMWARE: Register = Register::word(0, "firmware, major and minor");
const MODEL: Register = Register::word(3, "model number");
const ID: Register = Register::byte(5, "id");
const BAUD: Register = Register::byte(6, "baud rate");
pub(super) const RETURN_DELAY: Register = Register::byte(7, "return delay time");
pub(super) const STATUS_LEVEL: Register = Register::byte(8, "status return level");
const LOWEST: Register = Register::word(9, "minimum angle limit");
const HIGHEST: Register = Register::word(11, "maximum angle limit");
const HOTTEST: Register = Register::byte(13, "temperature limit");
const MAX_VOLTAGE: Register = Register::byte(14, "maximum voltage");
const MIN_VOLTAGE: Register = Register::byte(15, "minimum voltage");
const MAX_TORQUE: Register = Register::word(16, "maximum torque");
const P_GAIN: Register = Register::byte(21, "P gain");
const D_GAIN: Register = Register::byte(22, "D gain");
const CURRENT_PROTECTION: Register = Register::word(28, "protection current");
pub(super) const OFFSET: Register = Register::word(31, "position offset");
pub(super) const MODE: Register = Register::byte(33, "operating mode");
pub(super) const TORQUE: Register = Register::byte(40, "torque enable");
pub(super) const ACCELERATION: Register = Register::byte(41, "acceleration");
const GOAL: Register = Register::word(42, "goal position");
pub(super) const GOAL_TIME: Register = Register::word(44, "goal time");
pub(super) const GOAL_SPEED: Register = Register::word(46, "goal speed");
const TORQUE_LIMIT: Register = Register::word(48, "torque limit");
pub(super) const LOCK: Register = Register::byte(55, "EEPROM lock");
const POSITION: Register = Register::word(56, "present position");
const SPEED: Register = Register::word(58, "present speed");
const LOAD: Register = Register::word(60, "present load");
const VOLTAGE: Register = Register::byte(62, "present input voltage");
const TEMPERATURE: Register = Register::byte(63, "present temperature");
pub(super) const STATUS: Register = Register::byte(65, "status");
const MOVING: Register = Register::byte(66, "moving");
const CURRENT: Register = Register::word(69, "present current");

pub(super) const IDENTITY: Register = Register::new(0, 5, "firmware and model number");
pub(super) const PRESENT: Register = Register::new(56, 15, "present state");
pub(super) const SIGN_BIT: u32 = 15;
pub(super) const OFFSET_SIGN_BIT: u32 = 11;

pub(super) static REGISTERS: Registers = Registers {
    torque: TORQUE,
    goal: GOAL,
    present: PRESENT,
    service: Some(ServiceRegisters {
        id: ID,
        baud: BAUD,
        clock: None,
        last_id: 253,
        position: POSITION,
        voltage: VOLTAGE,
        temperature: TEMPERATURE,
        status: Some(STATUS),
        lock: Some(LOCK),
    }),
};

pub(super) const LIMITS: LimitRegisters = LimitRegisters {
    volts: (MIN_VOLTAGE, MAX_VOLTAGE),
    celsius: HOTTEST,
    ticks: (LOWEST, HIGHEST),
};

pub(super) static BAUDS: [u32; 8] =
    [1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400];

fn baud_of(code: u8) -> u32 {
    BAUDS.get(usize::from(code)).copied().unwrap_or(0)
}

pub(super) static STS: ByteMemory = ByteMemory {
    baud: Some((BAUD, baud_of)),
    ram: 40,
    model: Some(MODEL),
    return_delay: Some(RETURN_DELAY),
    status_level: Some(STATUS_LEVEL),
    goal_limits: Some((LOWEST, HIGHEST)),
    p_gain: Some(P_GAIN),
    offset: Some(OFFSET),
    goal_speed: Some(GOAL_SPEED),
    torque_limit: Some(TORQUE_LIMIT),
    speed: Some(SPEED),
    load: Some(LOAD),
    moving: Some(MOVING),
    current: Some(CURRENT),
    protection: Some(Protection {
        hottest: HOTTEST,
        max_voltage: MAX_VOLTAGE,
        min_voltage: MIN_VOLTAGE,
        conditions: (1, 1 << 2, 1 << 5),
        shutdown: None,
    }),
    last_writable: 55,
    factory: &[
        (FIRMWARE, 3 | 10 << 8),
        (RETURN_DELAY, 250),
        (STATUS_LEVEL, 1),
        (HIGHEST, 4095),
        (HOTTEST, 70),
        (MAX_VOLTAGE, 140),
        (MIN_VOLTAGE, 40),
        (MAX_TORQUE, 1000),
        (P_GAIN, 32),
        (D_GAIN, 32),
        (CURRENT_PROTECTION, 310),
        (TORQUE_LIMIT, 1000),
        (LOCK, 1),
    ],
    sync_read: true,
    reboots: true,
    ..ByteMemory::bare(&REGISTERS, 86)
};
