//! Motors on CAN: one bus driver, six families of motors, the ways to a bus.
//!
//! ```text
//! CanBus (arm, cycle, disarm) -> CanFamily (mit, robstride, odrive, ...) -> CanLink -> wire
//! ```
//!
//! A family is one folder with its registers, framing, driver and scan, listed in
//! `family.rs`; the simulated motors of `servodance-sim` use the same registers.

mod bus;
pub mod cia402;
mod client;
mod cycle_frames;
mod cycle_rate;
mod exchange;
pub(crate) mod families;
mod family;
pub mod mit;
mod models;
pub mod moteus;
mod motor;
pub mod myactuator;
pub mod odrive;
pub mod robstride;
mod rounding;
mod scan;
pub mod transport;

pub use bus::CanBus;
pub(crate) use cycle_rate::{check_can_rate, cycle_bits};
pub use family::IdSetting;
pub use motor::{MotorModel, MotorSettings};
pub use scan::{CanFound, CanScanner};
pub use transport::{CanEvent, CanFault, CanFrame, CanLink, CanPort, Sent};
