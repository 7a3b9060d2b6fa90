//! The memory of the OpenCR board of OP3: name, address and size, as in the vendor's
//! public firmware.
//!
//! The supply is in 0.1 V, roll, pitch and yaw in 0.1 degrees; rates have 16.4 to a
//! degree a second, forces 16384 to the acceleration of gravity.

#![allow(missing_docs)] // each register says its own name

use crate::serial::Register;

/// What the board says that it is.
pub const MODEL_NUMBER: u16 = 0x7400;
pub const FIRMWARE_VERSION: u8 = 5;
/// The memory's size, bytes.
pub const SIZE: usize = 51;

pub const MODEL: Register = Register::word(0, "model number");
pub const FIRMWARE: Register = Register::byte(2, "firmware");
pub const ID: Register = Register::byte(3, "id");
pub const BAUD: Register = Register::byte(4, "baud rate");
pub const RETURN_DELAY: Register = Register::byte(5, "return delay time");
pub const STATUS_RETURN_LEVEL: Register = Register::byte(16, "status return level");
pub const OFFSETS: Register = Register::new(18, 6, "roll, pitch and yaw offset");
pub const POWER: Register = Register::byte(24, "power of the servos");
pub const LED: Register = Register::byte(25, "LED");
pub const LED_RGB: Register = Register::word(26, "LED colour");
pub const BUZZER: Register = Register::word(28, "buzzer");
pub const BUTTON: Register = Register::byte(30, "button");
pub const VOLTAGE: Register = Register::byte(31, "input voltage");
pub const GYRO: Register = Register::new(32, 6, "rate of turn");
pub const FORCE: Register = Register::new(38, 6, "acceleration");
pub const ATTITUDE: Register = Register::new(44, 6, "roll, pitch and yaw");
pub const IMU_CONTROL: Register = Register::byte(50, "calibration of the sensor");

/// Rates, forces and attitude in one go.
pub const READING: Register = Register::new(32, 18, "motion sensor");
