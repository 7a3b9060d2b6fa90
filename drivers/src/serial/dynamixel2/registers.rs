//! The control table of the X series, and of MX with Protocol 2.0: name, address
//! and size, as the vendor's manual has them.
//!
//! Voltages are in 0.1 V, temperatures in degrees Celsius, positions in ticks,
//! the return delay in 2 us, the bus watchdog in 20 ms (0 off, -1 tripped).

#![allow(missing_docs)] // each register says its own name

use crate::serial::register::Register;
use crate::serial::registers::{Registers, ServiceRegisters};

pub const MODEL: Register = Register::new(0, 2, "model number");
pub const FIRMWARE: Register = Register::new(6, 1, "firmware");
pub const ID: Register = Register::new(7, 1, "id");
pub const BAUD: Register = Register::new(8, 1, "baud rate");
pub const RETURN_DELAY: Register = Register::new(9, 1, "return delay time");
pub const DRIVE_MODE: Register = Register::new(10, 1, "drive mode");
pub const OPERATING_MODE: Register = Register::new(11, 1, "operating mode");
pub const SHADOW_ID: Register = Register::new(12, 1, "secondary id");
pub const PROTOCOL_TYPE: Register = Register::new(13, 1, "protocol type");
pub const HOMING_OFFSET: Register = Register::new(20, 4, "homing offset");
pub const MOVING_THRESHOLD: Register = Register::new(24, 4, "moving threshold");
pub const TEMPERATURE_LIMIT: Register = Register::new(31, 1, "temperature limit");
pub const MAX_VOLTAGE: Register = Register::new(32, 2, "maximum voltage limit");
pub const MIN_VOLTAGE: Register = Register::new(34, 2, "minimum voltage limit");
pub const PWM_LIMIT: Register = Register::new(36, 2, "PWM limit");
pub const CURRENT_LIMIT: Register = Register::new(38, 2, "current limit");
pub const ACCELERATION_LIMIT: Register = Register::new(40, 4, "acceleration limit");
pub const VELOCITY_LIMIT: Register = Register::new(44, 4, "velocity limit");
pub const MAX_POSITION: Register = Register::new(48, 4, "maximum position limit");
pub const MIN_POSITION: Register = Register::new(52, 4, "minimum position limit");
pub const STARTUP: Register = Register::new(60, 1, "startup configuration");
pub const SHUTDOWN: Register = Register::new(63, 1, "shutdown");
pub const TORQUE: Register = Register::new(64, 1, "torque enable");
pub const LED: Register = Register::new(65, 1, "LED");
pub const STATUS_RETURN_LEVEL: Register = Register::new(68, 1, "status return level");
pub const REGISTERED: Register = Register::new(69, 1, "registered instruction");
pub const HARDWARE_ERROR: Register = Register::new(70, 1, "hardware error status");
pub const VELOCITY_I: Register = Register::new(76, 2, "velocity I gain");
pub const VELOCITY_P: Register = Register::new(78, 2, "velocity P gain");
pub const POSITION_D: Register = Register::new(80, 2, "position D gain");
pub const POSITION_I: Register = Register::new(82, 2, "position I gain");
pub const POSITION_P: Register = Register::new(84, 2, "position P gain");
pub const FEED_FORWARD_2: Register = Register::new(88, 2, "feedforward 2nd gain");
pub const FEED_FORWARD_1: Register = Register::new(90, 2, "feedforward 1st gain");
pub const BUS_WATCHDOG: Register = Register::new(98, 1, "bus watchdog");
pub const GOAL_PWM: Register = Register::new(100, 2, "goal PWM");
pub const GOAL_CURRENT: Register = Register::new(102, 2, "goal current");
pub const GOAL_VELOCITY: Register = Register::new(104, 4, "goal velocity");
pub const PROFILE_ACCELERATION: Register = Register::new(108, 4, "profile acceleration");
pub const PROFILE_VELOCITY: Register = Register::new(112, 4, "profile velocity");
pub const GOAL_POSITION: Register = Register::new(116, 4, "goal position");
pub const TICK_MS: Register = Register::new(120, 2, "realtime tick");
pub const MOVING: Register = Register::new(122, 1, "moving");
pub const MOVING_STATUS: Register = Register::new(123, 1, "moving status");
pub const PRESENT_PWM: Register = Register::new(124, 2, "present PWM");
pub const PRESENT_CURRENT: Register = Register::new(126, 2, "present current");
pub const PRESENT_VELOCITY: Register = Register::new(128, 4, "present velocity");
pub const PRESENT_POSITION: Register = Register::new(132, 4, "present position");
pub const VELOCITY_TRAJECTORY: Register = Register::new(136, 4, "velocity trajectory");
pub const POSITION_TRAJECTORY: Register = Register::new(140, 4, "position trajectory");
pub const PRESENT_VOLTAGE: Register = Register::new(144, 2, "present input voltage");
pub const PRESENT_TEMPERATURE: Register = Register::new(146, 1, "present temperature");
pub const BACKUP_READY: Register = Register::new(147, 1, "backup ready");

pub(super) const PRESENT: Register = Register::new(126, 10, "present state");

/// What a servo reports by the bits of its hardware error status, and by which of them it
/// shuts down.
pub(super) const CONDITIONS: [(u8, &str); 5] = [
    (0, "input voltage"),
    (2, "overheating"),
    (3, "encoder"),
    (4, "electrical shock"),
    (5, "overload"),
];

pub(super) static REGISTERS: Registers = Registers {
    torque: TORQUE,
    goal: GOAL_POSITION,
    present: PRESENT,
    service: Some(ServiceRegisters {
        id: ID,
        baud: BAUD,
        clock: Some(TICK_MS),
        last_id: 252,
        position: PRESENT_POSITION,
        voltage: PRESENT_VOLTAGE,
        temperature: PRESENT_TEMPERATURE,
        status: Some(HARDWARE_ERROR),
        lock: None,
    }),
};
