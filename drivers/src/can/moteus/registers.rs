//! Registers of moteus controllers, and the units in which each kind of number has them.
//!
//! ```text
//! id        source << 8 | destination, 8000 more where an answer is wanted; the host is 0
//! answer    motor << 8
//! ```
//!
//! Turns, turns a second, newton metres, seconds; integers count the units of [`scale`], and
//! their least value stands for NaN.

use super::kind::Kind;

pub const MODE: u16 = 0x000; // STOPPED, FAULT, POSITION, TIMED_OUT, ...
pub const POSITION: u16 = 0x001; // Of the output, turns
pub const VELOCITY: u16 = 0x002;
pub const TORQUE: u16 = 0x003;
pub const Q_CURRENT: u16 = 0x004;
pub const POWER: u16 = 0x007;
pub const MOTOR_TEMPERATURE: u16 = 0x00A;
pub const VOLTAGE: u16 = 0x00D;
pub const TEMPERATURE: u16 = 0x00E;
pub const FAULT: u16 = 0x00F; // Why the mode is FAULT
pub const GOAL_POSITION: u16 = 0x020; // NaN: no position is wanted
pub const GOAL_VELOCITY: u16 = 0x021;
pub const GOAL_TORQUE: u16 = 0x022; // Beside what the loop asks for
pub const KP_SCALE: u16 = 0x023; // Share of the controller's own gain
pub const KD_SCALE: u16 = 0x024;
pub const MOST_TORQUE: u16 = 0x025;
pub const WATCHDOG: u16 = 0x027; // Time without commands after which it times out; NaN: its own
pub const LAST_GOAL: u16 = 0x02D;
pub const MODEL: u16 = 0x100;
pub const FIRMWARE: u16 = 0x101;
pub const MAP_VERSION: u16 = 0x102;
pub const MULTIPLEX_ID: u16 = 0x110;
pub const SERIAL: u16 = 0x120; // Three registers
pub const SET_NEAREST: u16 = 0x130; // Where the output is has this position from now on
pub const SET_EXACT: u16 = 0x131;

pub const STOPPED: u8 = 0;
pub const FAULTY: u8 = 1;
pub const POSITION_MODE: u8 = 10;
pub const TIMED_OUT: u8 = 11; // Left by STOPPED alone
pub const ZERO_VELOCITY: u8 = 12;
pub const BRAKE: u8 = 15;

/// What one of an integer stands for.
pub fn scale(register: u16, kind: Kind) -> f64 {
    let [i8, i16, i32] = match register {
        POSITION | GOAL_POSITION | 0x006 | 0x026 | SET_NEAREST | SET_EXACT => [0.01, 1e-4, 1e-5],
        VELOCITY | GOAL_VELOCITY | 0x028 => [0.1, 2.5e-4, 1e-5],
        0x029 => [0.05, 1e-3, 1e-5],
        TORQUE | GOAL_TORQUE | MOST_TORQUE => [0.5, 0.01, 1e-3],
        Q_CURRENT | 0x005 | 0x01C | 0x01D => [1.0, 0.1, 1e-3],
        POWER => [10.0, 0.05, 1e-4],
        VOLTAGE => [0.5, 0.1, 1e-3],
        TEMPERATURE | MOTOR_TEMPERATURE => [1.0, 0.1, 1e-3],
        KP_SCALE | KD_SCALE | 0x02B => [1.0 / 127.0, 1.0 / 32_767.0, 1.0 / 2_147_483_647.0],
        WATCHDOG => [0.01, 1e-3, 1e-6],
        _ => [1.0; 3],
    };
    match kind {
        Kind::I8 => i8,
        Kind::I16 => i16,
        Kind::I32 => i32,
        Kind::F32 => 1.0,
    }
}

/// Why a controller is in mode FAULT.
pub(super) fn fault_name(code: u8) -> &'static str {
    match code {
        32 => "calibration fault",
        33 => "motor driver fault",
        34 => "over-voltage",
        35 => "encoder fault",
        36 => "motor not configured",
        37 => "PWM cycle overrun",
        38 => "overheating",
        39 => "outside its position limits",
        40 => "under-voltage",
        41 => "its configuration was changed",
        42 => "no valid commutation",
        43 => "no valid position",
        44 => "driver not enabled",
        46 => "timing violation",
        _ => "an unknown fault",
    }
}
