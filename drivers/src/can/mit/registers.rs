//! Ids, commands, registers and error codes of MIT mode.
//!
//! Only Damiao motors have registers: four bytes each, little-endian.

// First value of the last byte that makes a frame a mode command, after seven FF.
pub const FIRST_MODE_COMMAND: u8 = CLEAR;
pub const CLEAR: u8 = 0xFB; // Mode command: clears faults (Damiao)
pub const ENABLE: u8 = 0xFC; // Mode command: torque on, without any until the first target
pub const DISABLE: u8 = 0xFD; // Mode command: torque off
pub const SET_ZERO: u8 = 0xFE; // Mode command: where the motor stands is zero from now on

pub const REGISTER_ID: u32 = 0x7FF; // Id of requests to registers: motor id (u16), command, register, value
pub const READ: u8 = 0x33; // Register request: the motor answers with the register's value
pub const WRITE: u8 = 0x55; // Register request: the motor stores the value and answers with it
pub const SAVE: u8 = 0xAA; // Register request (fourth byte 1): registers are kept without power
pub const REFRESH: u8 = 0xCC; // Register request ("refresh"): the motor answers with a reply of MIT mode

pub type MitRegister = (u8, &'static str);

// Supply at which the motor shuts down, volts (f32).
pub const UNDER_VOLTAGE: MitRegister = (0, "UV_Value (V)");
// Temperature at which the motor shuts down, Celsius (f32).
pub const OVER_TEMPERATURE: MitRegister = (2, "OT_Value (C)");
pub const REPLY_ID: MitRegister = (7, "MST_ID"); // Id of the motor's replies
pub const MOTOR_ID: MitRegister = (8, "ESC_ID"); // Id that the motor listens to
// Time without commands after which torque goes off, units of 50 us; 0 is never.
// The unit is of the vendor's register list; almond-bot/axol, pull request 163, has
// it so from the motors themselves.
pub const TIMEOUT: MitRegister = (9, "TIMEOUT (50 us)");
pub const MODE: MitRegister = (10, "CTRL_MODE"); // Control mode; see MIT_MODE and below
pub const FIRMWARE: MitRegister = (14, "sw_ver"); // Firmware version
pub const PMAX: MitRegister = (21, "PMAX (rad)"); // Range of positions, +- radians (f32)
pub const VMAX: MitRegister = (22, "VMAX (rad/s)"); // Range of velocities, +- radians a second (f32)
pub const TMAX: MitRegister = (23, "TMAX (Nm)"); // Range of torques, +- newton metres (f32)
// Highest supply that the motor takes, volts (f32).
pub const OVER_VOLTAGE: MitRegister = (29, "OV_Value (V)");
pub const REGISTER_COUNT: usize = 37; // How many registers a motor keeps

pub const TIMEOUT_UNITS_PER_MS: u32 = 20; // Units of TIMEOUT a millisecond
pub const MIT_MODE: u32 = 1; // Value of MODE for MIT mode
pub const POSITION_VELOCITY_MODE: u32 = 2; // ... its own loops, to a position at most so fast
pub const VELOCITY_MODE: u32 = 3; // ... its own loop, at a velocity
// Added to the motor's id in commands of these modes: f32s, little-endian.
pub const POSITION_VELOCITY: u32 = 0x100; // position (rad), highest velocity (rad/s)
pub const VELOCITY: u32 = 0x200; // velocity (rad/s)

pub(super) const LOST: &str = "communication lost"; // Fault of a motor whose time-out has passed

/// The fault of Damiao's error nibble; `None` for 0 (disabled) and 1 (enabled).
pub(super) fn damiao_fault(nibble: u8) -> Option<&'static str> {
    Some(match nibble {
        0 | 1 => return None,
        8 => "over-voltage",
        9 => "under-voltage",
        0xA => "over-current",
        0xB => "MOSFET overheating",
        0xC => "coil overheating",
        0xD => LOST,
        0xE => "overload",
        _ => "an unknown error",
    })
}

/// The fault of a CubeMars error byte.
pub(super) fn cubemars_fault(code: u8) -> Option<&'static str> {
    Some(match code {
        0 => return None,
        1 => "motor overheating",
        2 => "over-current",
        3 => "over-voltage",
        4 => "under-voltage",
        5 => "encoder fault",
        6 => "MOSFET overheating",
        7 => "motor stalled",
        _ => "an unknown error",
    })
}

/// A RobStride motor's fault word in words.
pub(super) fn robstride_fault(faults: u32) -> String {
    const NAMES: [(u32, &str); 11] = [
        (0, "overheating"),
        (1, "driver chip fault"),
        (2, "under-voltage"),
        (3, "over-voltage"),
        (4, "over-current of phase B"),
        (5, "over-current of phase C"),
        (7, "encoder not calibrated"),
        (8, "hardware not recognised"),
        (9, "position not initialised"),
        (14, "overload"),
        (16, "over-current of phase A"),
    ];
    let set = NAMES.iter().filter(|(bit, _)| faults >> bit & 1 == 1);
    let names: Vec<&str> = set.map(|(_, name)| *name).collect();
    format!("{} (faults {faults:08X})", names.join(", "))
}
