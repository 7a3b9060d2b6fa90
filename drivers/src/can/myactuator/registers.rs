//! Commands of MyActuator RMD motors: motion protocol V4.2 (drivers V3), 11-bit ids.
//!
//! ```text
//! 140 + id   a command: its byte, then seven of data; 280 is for every motor
//! 240 + id   its answer: the same byte, then data, little-endian
//! 400 + id   motion mode: p[16] v[12] kp[12] kd[12] t[12], as MIT mode packs them
//! 500 + id   its answer: the id, p[16] v[12] t[12], two zeros: no temperature, no errors
//! ```

pub const COMMAND: u32 = 0x140; // To one motor
pub const EVERYONE: u32 = 0x280; // To every motor
pub const ANSWER: u32 = 0x240; // From one motor
pub const MOTION: u32 = 0x400; // Motion mode, to one motor
pub const MOTION_ANSWER: u32 = 0x500; // Motion mode, from one motor
pub const ID_SETTING: u32 = 0x300; // Reads (third byte 1) or writes (0) the id, whatever it is
pub const LAST_ID: u8 = 32;

pub const SET_ID: u8 = 0x79; // The command of ID_SETTING
pub const ZERO_HERE: u8 = 0x64; // Where the motor stands is zero after the next reset
pub const MODE: u8 = 0x70; // Its loop: current (1), speed (2), position (3)
pub const RESET: u8 = 0x76; // Restarts the motor; not answered
pub const BRAKE_OPEN: u8 = 0x77; // Opens the holding brake
pub const BRAKE_SHUT: u8 = 0x78; // Closes the holding brake
pub const SHUTDOWN: u8 = 0x80; // Torque off
pub const STOP: u8 = 0x81; // Speed zero, torque stays on
pub const ANGLE: u8 = 0x92; // Angle of the shaft over several turns (i32, 0.01 degrees)
pub const STATUS: u8 = 0x9A; // Temperature (i8), brake, supply (u16, 0.1 V), errors (u16)
pub const STATE: u8 = 0x9C; // Temperature (i8), current (i16, 0.01 A), speed (i16, degrees a second), angle (i16, degrees)
pub const SPEED: u8 = 0xA2; // Speed wanted (i32, 0.01 degrees a second); answered as STATE
pub const POSITION: u8 = 0xA4; // Angle wanted (i32, 0.01 degrees); answered as STATE
pub const RUN_TIME: u8 = 0xB1; // Time since the start (u32, ms)
pub const VERSION: u8 = 0xB2; // Date of the firmware, as a number: 20220206 (u32)
// Time without commands after which torque goes off (u32, ms; 0 is never). Kept without power,
// and cannot be read. A motor that has stopped goes on with the next command.
pub const TIMEOUT: u8 = 0xB3;
pub const MODEL: u8 = 0xB5; // Seven letters, as "X8S2V10"

/// The names of the bits of an error word; `None` without errors.
pub(super) fn error_names(errors: u16) -> Option<String> {
    const NAMES: [(u16, &str); 9] = [
        (0x0002, "motor stalled"),
        (0x0004, "under-voltage"),
        (0x0008, "over-voltage"),
        (0x0010, "over-current"),
        (0x0040, "too much power"),
        (0x0080, "calibration not written"),
        (0x0100, "too fast"),
        (0x1000, "motor overheating"),
        (0x2000, "encoder calibration error"),
    ];
    if errors == 0 {
        return None;
    }
    let names = NAMES.iter().filter(|(bit, _)| errors & bit != 0).map(|(_, name)| *name);
    let names: Vec<&str> = names.collect();
    Some(format!("{} (errors {errors:04X})", names.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_named_with_their_number() {
        let says = "motor stalled, under-voltage, over-current (errors 0016)";
        assert_eq!(error_names(0x16).as_deref(), Some(says));
        assert_eq!(error_names(0), None);
    }
}
