//! The memory of Feetech STS servos, as the vendor's tables have it.

#![allow(missing_docs)] // each register says its own name

use crate::serial::family::prelude::*;

pub(super) const FIRMWARE: Register = Register::word(0, "firmware");
pub(super) const MODEL: Register = Register::word(3, "model number");
pub(super) const ID: Register = Register::byte(5, "id");
pub(super) const BAUD: Register = Register::byte(6, "baud rate");
pub(super) const RETURN_DELAY: Register = Register::byte(7, "return delay time");
pub(super) const STATUS_LEVEL: Register = Register::byte(8, "status return level");
pub(super) const LOWEST: Register = Register::word(9, "minimum angle limit");
pub(super) const HIGHEST: Register = Register::word(11, "maximum angle limit");
pub(super) const HOTTEST: Register = Register::byte(13, "temperature limit");
pub(super) const MAX_VOLTAGE: Register = Register::byte(14, "maximum voltage");
pub(super) const MIN_VOLTAGE: Register = Register::byte(15, "minimum voltage");
pub(super) const MAX_TORQUE: Register = Register::word(16, "maximum torque");
pub(super) const PHASE: Register = Register::byte(18, "phase");
pub(super) const UNLOADING: Register = Register::byte(19, "unloading condition");
pub(super) const ALARM_LED: Register = Register::byte(20, "alarm LED");
pub(super) const P_GAIN: Register = Register::byte(21, "P gain");
pub(super) const D_GAIN: Register = Register::byte(22, "D gain");
pub(super) const I_GAIN: Register = Register::byte(23, "I gain");
pub(super) const STARTUP_FORCE: Register = Register::word(24, "minimum startup force");
pub(super) const CW_DEAD_ZONE: Register = Register::byte(26, "clockwise dead zone");
pub(super) const CCW_DEAD_ZONE: Register = Register::byte(27, "counterclockwise dead zone");
pub(super) const CURRENT_PROTECTION: Register = Register::word(28, "protection current");
pub(super) const RESOLUTION: Register = Register::byte(30, "angular resolution");
pub(super) const OFFSET: Register = Register::word(31, "position offset");
pub(super) const MODE: Register = Register::byte(33, "operating mode");
pub(super) const PROTECTIVE_TORQUE: Register = Register::byte(34, "protective torque");
pub(super) const PROTECTION_TIME: Register = Register::byte(35, "protection time");
pub(super) const OVERLOAD_TORQUE: Register = Register::byte(36, "overload torque");
pub(super) const SPEED_P: Register = Register::byte(37, "speed P gain");
pub(super) const OVERCURRENT_TIME: Register = Register::byte(38, "overcurrent protection time");
pub(super) const SPEED_I: Register = Register::byte(39, "speed I gain");
pub(super) const TORQUE: Register = Register::byte(40, "torque enable");
pub(super) const ACCELERATION: Register = Register::byte(41, "acceleration");
pub(super) const GOAL: Register = Register::word(42, "goal position");
pub(super) const GOAL_TIME: Register = Register::word(44, "goal time");
pub(super) const GOAL_SPEED: Register = Register::word(46, "goal speed");
pub(super) const TORQUE_LIMIT: Register = Register::word(48, "torque limit");
pub(super) const LOCK: Register = Register::byte(55, "EEPROM lock");
pub(super) const POSITION: Register = Register::word(56, "present position");
pub(super) const SPEED: Register = Register::word(58, "present speed");
pub(super) const LOAD: Register = Register::word(60, "present load");
pub(super) const VOLTAGE: Register = Register::byte(62, "present input voltage");
pub(super) const TEMPERATURE: Register = Register::byte(63, "present temperature");
pub(super) const STATUS: Register = Register::byte(65, "status");
pub(super) const MOVING: Register = Register::byte(66, "moving");
pub(super) const CURRENT: Register = Register::word(69, "present current");

pub(super) const IDENTITY: Register = Register::new(0, 5, "firmware and model number");
pub(super) const PRESENT: Register = Register::new(56, 15, "present state");
pub(super) const SIGN_BIT: u32 = 15;
pub(super) const OFFSET_SIGN_BIT: u32 = 11;

/// What a servo reports by the bits of its status.
pub(super) const CONDITIONS: [(u8, &str); 6] = [
    (0, "voltage"),
    (1, "angle sensor"),
    (2, "overheating"),
    (3, "overcurrent"),
    (4, "angle"),
    (5, "overload"),
];

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

pub(super) fn baud_of(code: u8) -> u32 {
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
    mode: Some(MODE),
    acceleration: Some(ACCELERATION),
    goal_time: Some(GOAL_TIME),
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
