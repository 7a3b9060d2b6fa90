//! Message types and parameters of RobStride motors.
//!
//! ```text
//! id         type << 24 | data16 << 8 | motor          (to the motor)
//! feedback   2 << 24 | mode << 22 | faults << 16 | motor << 8 | host
//!            p[16] v[16] t[16] temperature[16], big-endian
//! control    type 1, data16 = torque, p[16] v[16] kp[16] kd[16], big-endian
//! parameters type 17 read, 18 write: index u16, 0, 0, value, little-endian
//! ```

pub const HOST: u32 = 0xFD; // Id of the host on the bus
pub const EVERY_HOST: u32 = 0xFE; // Addressee of an answer to GET_ID: every host

/// Types of message, bits 24 to 28 of an id.
pub mod message {
    pub const GET_ID: u32 = 0; // Asks for the motor's id and unique number
    pub const CONTROL: u32 = 1; // Position, velocity, gains and torque of operation control
    pub const FEEDBACK: u32 = 2; // The motor's report
    pub const ENABLE: u32 = 3; // Turns torque on
    pub const STOP: u32 = 4; // Turns torque off; a first byte of 1 clears faults too
    pub const SET_ZERO: u32 = 6; // Where the motor stands is zero (first byte 1)
    pub const SET_ID: u32 = 7; // Another id: the upper byte of data16; answered as GET_ID
    pub const READ: u32 = 17; // Reads a parameter
    pub const WRITE: u32 = 18; // Writes a parameter; the motor answers with a feedback
    pub const SAVE: u32 = 22; // Parameters are kept without power (data 1 to 8)
    pub const FAULT: u32 = 21; // The motor's detailed faults, sent unasked
}

pub type MotorParameter = (u16, &'static str);

// Run mode; 0 is operation control. Changes with torque off only.
pub const MODE: MotorParameter = (0x7005, "run mode (7005)");
pub const TORQUE_LIMIT: MotorParameter = (0x700B, "torque limit (700B)"); // Most torque, newton metres (f32)
pub const BUS_VOLTAGE: MotorParameter = (0x701C, "bus voltage (701C)"); // Supply, volts (f32, read only)
// Time without commands after which torque goes off, units of 50 us; 0 is never.
// From RobStride's parameter list (canTimeout), as repeated on
// motorbridge.seeedstudio.com/reference/robstride-parameter-tables.
pub const TIMEOUT: MotorParameter = (0x7028, "CAN time-out (7028)");

pub const TIMEOUT_UNITS_PER_MS: u32 = 20; // Units of TIMEOUT a millisecond
pub const RUNNING: u32 = 2; // Mode bits of a feedback's id while torque is on

/// The 29-bit id of a message.
pub fn id(message: u32, data16: u32, addressee: u32) -> u32 {
    message << 24 | data16 << 8 | addressee
}
