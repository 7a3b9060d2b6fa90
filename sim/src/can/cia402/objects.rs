//! The objects of a simulated drive. Keys are index << 8 | subindex.

use servodance_drivers::can::cia402::registers::{self, SdoObject};

pub(super) const ABORT_READ_ONLY: u32 = 0x0601_0002;
pub(super) const ABORT_NO_OBJECT: u32 = 0x0602_0000;
pub(super) const ABORT_LENGTH: u32 = 0x0607_0010;
pub(super) const ABORT_NO_SUBINDEX: u32 = 0x0609_0011;
pub(super) const ABORT_STATE: u32 = 0x0800_0022;

const fn key(object: SdoObject) -> u32 {
    (object.0 as u32) << 8 | object.1 as u32
}
pub(super) const CONSUMER: u32 = key(registers::CONSUMER);
pub(super) const ABORT_OPTION: u32 = key(registers::ABORT_OPTION);
pub(super) const CONTROL: u32 = key(registers::CONTROL);
pub(super) const STATUS: u32 = key(registers::STATUS);
pub(super) const MODE: u32 = key(registers::MODE);
pub(super) const MODE_SHOWN: u32 = key(registers::MODE_SHOWN);
pub(super) const POSITION: u32 = key(registers::POSITION);
pub(super) const VELOCITY: u32 = 0x606C00; // Increments a second
pub(super) const SUPPORTED_MODES: u32 = 0x650200;
pub(super) const MAX_TORQUE: u32 = key(registers::MAX_TORQUE);
pub(super) const TORQUE: u32 = key(registers::TORQUE);
pub(super) const TARGET: u32 = key(registers::TARGET);
pub(super) const DEVICE_TYPE: u32 = key(registers::DEVICE_TYPE);
pub(super) const ERROR_CODE: u32 = key(registers::ERROR_CODE);
pub(super) const RPDO_ID: u32 = (registers::RPDO_PARAMETERS.0 as u32) << 8 | 1;
pub(super) const TPDO_ID: u32 = (registers::TPDO_PARAMETERS.0 as u32) << 8 | 1;

/// Objects that can be written, with their bytes; they are 0 at first.
pub(super) const WRITABLE: [(u32, u8); 20] = [
    (CONSUMER, 4),
    (0x101700, 2),
    (RPDO_ID, 4),
    (0x140002, 1),
    (0x160000, 1),
    (0x160001, 4),
    (0x160002, 4),
    (0x160003, 4),
    (TPDO_ID, 4),
    (0x180002, 1),
    (0x1A0000, 1),
    (0x1A0001, 4),
    (0x1A0002, 4),
    (0x1A0003, 4),
    (ABORT_OPTION, 2),
    (CONTROL, 2),
    (MODE, 1),
    (MAX_TORQUE, 2),
    (TARGET, 4),
    (0x60C201, 1),
];
