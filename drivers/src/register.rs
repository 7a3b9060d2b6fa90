//! The registers of the X series control table that the driver uses.

use crate::dialect::names_of;

/// Where a value lives in the control table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// First address.
    pub address: u16,
    /// Bytes: 1, 2 or 4, little-endian.
    pub size: u16,
    /// The name for messages.
    pub name: &'static str,
}

/// A place in a control table.
pub const fn register(address: u16, size: u16, name: &'static str) -> Register {
    Register {
        address,
        size,
        name,
    }
}

impl Register {
    /// Units of 2 us between an instruction and its reply.
    pub const RETURN_DELAY: Self = register(9, 1, "return delay time");
    /// Direction, profile kind, torque on by goal.
    pub const DRIVE_MODE: Self = register(10, 1, "drive mode");
    /// 3 is position control within a turn.
    pub const OPERATING_MODE: Self = register(11, 1, "operating mode");
    /// Degrees Celsius at which the servo shuts down.
    pub const TEMPERATURE_LIMIT: Self = register(31, 1, "temperature limit");
    /// 0.1 V.
    pub const MAX_VOLTAGE: Self = register(32, 2, "maximum voltage limit");
    /// 0.1 V.
    pub const MIN_VOLTAGE: Self = register(34, 2, "minimum voltage limit");
    /// The servo's own highest velocity, in the model's units.
    pub const VELOCITY_LIMIT: Self = register(44, 4, "velocity limit");
    /// The servo's own highest goal.
    pub const MAX_POSITION: Self = register(48, 4, "maximum position limit");
    /// The servo's own lowest goal.
    pub const MIN_POSITION: Self = register(52, 4, "minimum position limit");
    /// 1 is torque on.
    pub const TORQUE: Self = register(64, 1, "torque enable");
    /// 2: every instruction is answered.
    pub const STATUS_RETURN_LEVEL: Self = register(68, 1, "status return level");
    /// Flags; not zero after a shutdown.
    pub const HARDWARE_ERROR: Self = register(70, 1, "hardware error status");
    /// Highest current, in the model's units.
    pub const CURRENT_LIMIT: Self = register(38, 2, "current limit");
    /// Units of 20 ms; 0 off; -1 tripped.
    pub const BUS_WATCHDOG: Self = register(98, 1, "bus watchdog");
    /// 0 is no limit: the host shapes the motion.
    pub const PROFILE_ACCELERATION: Self = register(108, 4, "profile acceleration");
    /// 0 is no limit: the host shapes the motion.
    pub const PROFILE_VELOCITY: Self = register(112, 4, "profile velocity");
    /// Ticks.
    pub const GOAL_POSITION: Self = register(116, 4, "goal position");
    /// Present current, velocity and position: ten bytes in a row.
    pub const PRESENT: Self = register(126, 10, "present state");
    /// 0.1 V (two bytes) and degrees Celsius.
    pub const VOLTAGE_AND_TEMPERATURE: Self = register(144, 3, "present voltage and temperature");

    /// The unsigned value in `bytes` (little-endian, at most 8 bytes).
    pub fn value(self, bytes: &[u8]) -> u64 {
        bytes
            .iter()
            .rev()
            .fold(0, |value, byte| value << 8 | u64::from(*byte))
    }
}

/// The hardware error flags in words.
pub fn hardware_error_names(flags: u8) -> String {
    const NAMES: [(u8, &str); 5] = [
        (0, "input voltage"),
        (2, "overheating"),
        (3, "encoder"),
        (4, "electrical shock"),
        (5, "overload"),
    ];
    names_of(flags, &NAMES)
}
