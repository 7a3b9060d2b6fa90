//! Servos on a serial bus: requests and replies, and the families that differ.
//!
//! ```text
//! SerialBus (arm, cycle, disarm)  -> ServoClient (requests, retries) -> wire/ (packets, port)
//!     |  preflight.rs, rejoin.rs          timeout.rs
//!     `-> ServoFamily: dynamixel2/, dynamixel1/, feetech/ (registers, models, rates, tables)
//! ```
//!
//! The `dynamixel2` crate gives the instruction numbers and the CRC of Protocol 2.0;
//! its own bus is not used, because it knows neither Protocol 1 nor Fast Sync Read
//! and blocks for as long as a damaged packet says.

pub(crate) mod bus;
mod client;
mod deviation;
pub(crate) mod device_read;
pub mod dynamixel1;
pub mod dynamixel2;
pub(crate) mod families;
mod family;
pub mod feetech;
mod goal_timing;
mod limits;
mod losses;
mod memory;
mod missing;
mod patience;
mod preflight;
mod register;
mod registers;
mod rejoin;
pub(crate) mod scan;
mod silence;
pub mod table;
mod timeout;
mod watchdogs;
pub(crate) mod wire;

pub use bus::SerialBus;
pub use client::ServoClient;
pub use deviation::{Deviation, Remedy, ServoDeviation};
pub use families::{FAMILIES, family_of};
pub use family::{FACTORY_ID, ServoFamily};
pub use memory::{BaudDecoder, ByteMemory, Firmware, Protection};
pub use register::{Register, sign_magnitude};
pub use registers::{CycleBytes, Identity, OwnLimits, PresentState, Registers, ServiceRegisters};

#[allow(missing_docs)] // the vendor's names
pub mod instruction {
    pub use dynamixel2::instructions::instruction_id::*;
    pub const BACKUP: u8 = 0x20;
    pub const FAST_SYNC_READ: u8 = 0x8A;
    pub const FAST_BULK_READ: u8 = 0x9A;
}
