//! Motors on CAN: frames, ways to a bus, and the protocols of four families.
//!
//! ```text
//! CanBus (arm, cycle, disarm) -> Protocol (MIT, RobStride, ODrive, CiA 402) -> CanLink -> wire
//! ```
//!
//! A new kind of link implements [`CanLink`].

mod frame;
mod link;
mod motor;
mod rate;

pub use frame::{CanFrame, nominal_bits, worst_bits};
pub use link::{CanFault, CanLink, CanPort, Received, Sent};
pub use motor::{MotorModel, MotorSettings};
pub(crate) use rate::check_can_rate;
pub use rate::{CycleBits, cycle_bits};
