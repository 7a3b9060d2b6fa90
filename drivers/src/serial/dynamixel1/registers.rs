//! The memory of AX servos, and of MX with Protocol 1.0, as the vendor's manuals have it.

#![allow(missing_docs)] // each register says its own name

use crate::serial::family::prelude::*;

pub(super) const MODEL: Register = Register::word(0, "model number");
pub(super) const FIRMWARE: Register = Register::byte(2, "firmware");
pub(super) const ID: Register = Register::byte(3, "id");
pub(super) const BAUD: Register = Register::byte(4, "baud rate");
pub(super) const RETURN_DELAY: Register = Register::byte(5, "return delay time");
pub(super) const LOWEST: Register = Register::word(6, "clockwise angle limit");
pub(super) const HIGHEST: Register = Register::word(8, "counterclockwise angle limit");
pub(super) const HOTTEST: Register = Register::byte(11, "temperature limit");
pub(super) const MIN_VOLTAGE: Register = Register::byte(12, "lowest voltage");
pub(super) const MAX_VOLTAGE: Register = Register::byte(13, "highest voltage");
pub(super) const MAX_TORQUE: Register = Register::word(14, "maximum torque");
pub(super) const STATUS_LEVEL: Register = Register::byte(16, "status return level");
pub(super) const ALARM_LED: Register = Register::byte(17, "alarm LED");
pub(super) const SHUTDOWN: Register = Register::byte(18, "shutdown");
pub(super) const TORQUE: Register = Register::byte(24, "torque enable");
pub(super) const LED: Register = Register::byte(25, "LED");
pub(super) const CW_MARGIN: Register = Register::byte(26, "clockwise compliance margin");
pub(super) const CCW_MARGIN: Register = Register::byte(27, "counterclockwise compliance margin");
pub(super) const CW_SLOPE: Register = Register::byte(28, "clockwise compliance slope");
pub(super) const CCW_SLOPE: Register = Register::byte(29, "counterclockwise compliance slope");
pub(super) const D_GAIN: Register = Register::byte(26, "D gain"); // MX only
pub(super) const I_GAIN: Register = Register::byte(27, "I gain"); // MX only
pub(super) const P_GAIN: Register = Register::byte(28, "P gain");
pub(super) const GOAL: Register = Register::word(30, "goal position");
pub(super) const SPEED: Register = Register::word(32, "moving speed");
pub(super) const TORQUE_LIMIT: Register = Register::word(34, "torque limit");
pub(super) const POSITION: Register = Register::word(36, "present position");
pub(super) const PRESENT_SPEED: Register = Register::word(38, "present speed");
pub(super) const LOAD: Register = Register::word(40, "present load");
pub(super) const VOLTAGE: Register = Register::byte(42, "present input voltage");
pub(super) const TEMPERATURE: Register = Register::byte(43, "present temperature");
pub(super) const REGISTERED: Register = Register::byte(44, "registered instruction");
pub(super) const MOVING: Register = Register::byte(46, "moving");
pub(super) const LOCK: Register = Register::byte(47, "EEPROM lock");
pub(super) const PUNCH: Register = Register::word(48, "punch");
pub(super) const TORQUE_MODE: Register = Register::byte(70, "torque control mode"); // MX only
pub(super) const ACCELERATION: Register = Register::byte(73, "goal acceleration"); // MX only

pub(super) const IDENTITY: Register = Register::new(0, 3, "model number and firmware");
pub(super) const PRESENT: Register = Register::new(36, 8, "present state");
pub(super) const SIGN_BIT: u32 = 10;

/// What a servo reports by the bits of its error byte, and by which of them it shuts down.
pub(super) const CONDITIONS: [(u8, &str); 4] =
    [(0, "input voltage"), (1, "angle limit"), (2, "overheating"), (5, "overload")];

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
        status: None,
        lock: None,
    }),
};

pub(super) const LIMITS: LimitRegisters = LimitRegisters {
    volts: (MIN_VOLTAGE, MAX_VOLTAGE),
    celsius: HOTTEST,
    ticks: (LOWEST, HIGHEST),
};

/// The rate that a baud register means: 2 Mbps divided, and some faster ones of MX.
pub(super) fn baud_of(code: u8) -> u32 {
    match code {
        250 => 2_250_000,
        251 => 2_500_000,
        252 => 3_000_000,
        code => 2_000_000 / (u32::from(code) + 1),
    }
}

const AX_MEMORY: ByteMemory = ByteMemory {
    baud: Some((BAUD, baud_of)),
    ram: 24,
    model: Some(MODEL),
    return_delay: Some(RETURN_DELAY),
    status_level: Some(STATUS_LEVEL),
    goal_limits: Some((LOWEST, HIGHEST)),
    goal_speed: Some(SPEED),
    torque_limit: Some(TORQUE_LIMIT),
    speed: Some(PRESENT_SPEED),
    load: Some(LOAD),
    moving: Some(MOVING),
    protection: Some(Protection {
        hottest: HOTTEST,
        max_voltage: MAX_VOLTAGE,
        min_voltage: MIN_VOLTAGE,
        conditions: (1, 1 << 2, 1 << 5),
        shutdown: Some(SHUTDOWN),
    }),
    last_writable: 35,
    also_writable: &[44, 47, 48, 49],
    factory: &[
        (FIRMWARE, 24),
        (BAUD, 1),
        (RETURN_DELAY, 250),
        (HIGHEST, 1023),
        (HOTTEST, 70),
        (MIN_VOLTAGE, 60),
        (MAX_VOLTAGE, 140),
        (MAX_TORQUE, 1023),
        (STATUS_LEVEL, 2),
        (ALARM_LED, 36),
        (SHUTDOWN, 36),
        (CW_MARGIN, 1),
        (CCW_MARGIN, 1),
        (CW_SLOPE, 32),
        (CCW_SLOPE, 32),
        (TORQUE_LIMIT, 1023),
        (PUNCH, 32),
    ],
    sign_bit: SIGN_BIT,
    refuses_goals: true,
    ..ByteMemory::bare(&REGISTERS, 50)
};

/// AX-12A and AX-18A; compliance margins and slopes are not simulated.
pub(super) static AX: ByteMemory = AX_MEMORY;

/// MX-28, MX-64 and MX-106 with Protocol 1.0.
pub(super) static MX1: ByteMemory = ByteMemory {
    size: 74,
    p_gain: Some(P_GAIN),
    also_writable: &[44, 47, 48, 49, 70, 71, 72, 73],
    factory: &[
        (FIRMWARE, 36),
        (BAUD, 34),
        (RETURN_DELAY, 250),
        (HIGHEST, 4095),
        (HOTTEST, 80),
        (MIN_VOLTAGE, 60),
        (MAX_VOLTAGE, 160),
        (MAX_TORQUE, 1023),
        (STATUS_LEVEL, 2),
        (ALARM_LED, 36),
        (SHUTDOWN, 36),
        (P_GAIN, 32),
        (TORQUE_LIMIT, 1023),
    ],
    bulk_read: true,
    ..AX_MEMORY
};
