//! Objects and messages of CiA 402 drives over CANopen.
//!
//! ```text
//! 200 + id  RPDO1  control word, target position      (6 bytes)
//! 180 + id  TPDO1  status word, position, torque      (8 bytes), on SYNC (080)
//! 600 + id  SDO to the drive, 580 + id its answer (expedited transfers only)
//! 700 + 127 the host's heartbeat, one a cycle; the drives watch it (1016)
//! 080 + id  emergency
//! ```

pub const SYNC: u32 = 0x080; // Id of the message that makes drives act on their RPDO and send their TPDO
pub const EMERGENCY: u32 = 0x080; // Id of emergencies, plus the node
pub const TPDO: u32 = 0x180; // Id of TPDO1, plus the node
pub const RPDO: u32 = 0x200; // Id of RPDO1, plus the node
pub const SDO_ANSWER: u32 = 0x580; // Id of SDO answers, plus the node
pub const SDO_REQUEST: u32 = 0x600; // Id of SDO requests, plus the node
pub const HEARTBEAT: u32 = 0x700; // Id of heartbeats, plus the node
pub const PDO_OFF: u32 = 1 << 31; // Bit of a PDO's id that turns the PDO off

pub const OPERATIONAL: u8 = 5; // NMT state in a heartbeat: PDOs are exchanged
pub const NMT_START: u8 = 1; // NMT command: become operational
pub const NMT_PRE_OPERATIONAL: u8 = 128; // NMT command: become pre-operational

pub const UPLOAD: u8 = 0x40; // SDO command: read an object
pub const DOWNLOADED: u8 = 0x60; // SDO answer to a written object
pub const ABORT: u8 = 0x80; // SDO answer: refused, with a code

/// An object: index, subindex, bytes, and its name in messages.
pub type SdoObject = (u16, u8, u8, &'static str);

pub const DEVICE_TYPE: SdoObject = (0x1000, 0, 4, "device type (1000)"); // Device profile in the low word
// Consumer heartbeat: watched node << 16 | milliseconds.
pub const CONSUMER: SdoObject = (0x1016, 1, 4, "consumer heartbeat (1016)");
pub const REVISION: SdoObject = (0x1018, 3, 4, "revision (1018)"); // Revision of the device
// Code of the last error; classes of CiA 402.
pub const ERROR_CODE: SdoObject = (0x603F, 0, 2, "error code (603F)");
// What the drive does when its communication is lost.
pub const ABORT_OPTION: SdoObject = (0x6007, 0, 2, "abort option (6007)");
pub const CONTROL: SdoObject = (0x6040, 0, 2, "control word (6040)"); // Control word: moves the state machine
pub const STATUS: SdoObject = (0x6041, 0, 2, "status word (6041)"); // Status word: shows the state machine
pub const MODE: SdoObject = (0x6060, 0, 1, "mode (6060)"); // Mode of operation
pub const MODE_SHOWN: SdoObject = (0x6061, 0, 1, "mode display (6061)"); // Mode that is in effect
pub const POSITION: SdoObject = (0x6064, 0, 4, "position (6064)"); // Actual position, increments
// Most torque, per mille of the rated torque.
pub const MAX_TORQUE: SdoObject = (0x6072, 0, 2, "max torque (6072)");
pub const TORQUE: SdoObject = (0x6077, 0, 2, "torque (6077)"); // Actual torque, per mille of the rated torque
pub const TARGET: SdoObject = (0x607A, 0, 4, "target position (607A)"); // Target position, increments

pub const RPDO_PARAMETERS: (u16, u16) = (0x1400, 0x1600); // Communication and mapping parameters of RPDO1
pub const TPDO_PARAMETERS: (u16, u16) = (0x1800, 0x1A00); // Communication and mapping parameters of TPDO1

pub const CYCLIC_POSITION: u32 = 8; // Value of MODE for cyclic synchronous position
pub const FAULT: u16 = 1 << 3; // Bit of the status word that shows a fault
pub const FAULT_RESET: u32 = 0x80; // Bit of the control word that clears a fault

/// An object as an entry of a PDO mapping: index, subindex, bits.
pub const fn mapped(object: SdoObject) -> u32 {
    (object.0 as u32) << 16 | (object.1 as u32) << 8 | (8 * object.2 as u32)
}

/// SDO command that writes an object of 1, 2 or 4 bytes in one frame.
pub fn download(object: SdoObject) -> u8 {
    0x23 | (4 - object.2) << 2
}
