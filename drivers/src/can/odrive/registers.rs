//! Messages of CANSimple, firmware 0.6: 11-bit ids `node << 5 | message`.
//!
//! A remote frame with a message's id asks for it.

pub const VERSION: u32 = 0x00; // Asks for protocol, hardware (three bytes) and firmware (three bytes)
pub const HEARTBEAT: u32 = 0x01; // Errors (u32), axis state, results; sent ten times a second
pub const ESTOP: u32 = 0x02; // Emergency stop
pub const ERROR: u32 = 0x03; // Active errors (u32) and the reason of the last disarm (u32)
pub const RX_SDO: u32 = 0x04; // Reads (first byte 0) or writes (1) a parameter by its endpoint
pub const TX_SDO: u32 = 0x05; // The value of a parameter
pub const ADDRESS: u32 = 0x06; // Node id (u8) and serial number (48 bits); sent to a node, its new id
pub const SET_STATE: u32 = 0x07; // Requests an axis state: IDLE or CLOSED_LOOP
pub const ENCODER: u32 = 0x09; // Position (turns, f32) and velocity (turns a second, f32) of the motor
pub const MODES: u32 = 0x0B; // Control mode (u32) and input mode (u32)
pub const INPUT_POSITION: u32 = 0x0C; // Target position (turns, f32)
pub const INPUT_VELOCITY: u32 = 0x0D; // Target velocity (turns a second, f32) and torque (f32)
pub const INPUT_TORQUE: u32 = 0x0E; // Target torque (newton metres, f32)
pub const LIMITS: u32 = 0x0F; // Velocity limit (turns a second, f32) and current limit (amperes, f32)
pub const CURRENTS: u32 = 0x14; // Phase current wanted and measured (amperes, f32)
pub const TEMPERATURES: u32 = 0x15; // Temperature of inverter and motor (Celsius, f32; NaN without a sensor)
pub const REBOOT: u32 = 0x16; // Restarts the controller
pub const SAVE: u8 = 1; // With REBOOT: settings are kept without power
pub const BUS_VOLTAGE: u32 = 0x17; // Supply (volts, f32) and its current (amperes, f32)
pub const CLEAR_ERRORS: u32 = 0x18; // Clears errors
pub const POSITION_GAIN: u32 = 0x1A; // Position gain (turns a second a turn, f32)
pub const VELOCITY_GAINS: u32 = 0x1B; // Velocity gain (newton metre seconds a turn, f32) and its integrator
pub const TORQUES: u32 = 0x1C; // Torque target and torque estimate (newton metres, f32)
pub const POWERS: u32 = 0x1D; // Electrical and mechanical power (watts, f32)

pub const IDLE: u8 = 1; // Axis state with torque off
pub const CLOSED_LOOP: u8 = 8; // Axis state with torque on
pub(super) const LAST_STATE: u8 = 14; // The last of the axis states
pub const TORQUE_CONTROL: u32 = 1; // Control mode: torque
pub const VELOCITY_CONTROL: u32 = 2; // Control mode: velocity
pub const POSITION_CONTROL: u32 = 3; // Control mode: position
pub const PASSTHROUGH: u32 = 1; // Input mode: targets are followed as they come

/// The 11-bit id of a message from or to a node.
pub fn id(node: u8, message: u32) -> u32 {
    u32::from(node) << 5 | message
}

/// The eight bytes of two little-endian words.
pub fn two_words(a: [u8; 4], b: [u8; 4]) -> [u8; 8] {
    let ([a0, a1, a2, a3], [b0, b1, b2, b3]) = (a, b);
    [a0, a1, a2, a3, b0, b1, b2, b3]
}
