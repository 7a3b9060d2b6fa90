//! Motors on CAN: frames, ways to a bus, and the protocols of four families.
//!
//! ```text
//! CanBus (arm, cycle, disarm) -> Protocol (MIT, RobStride, ODrive, CiA 402) -> CanLink -> wire
//! ```
//!
//! A new kind of link implements [`CanLink`] and gets its line in [`open_link`].

mod bus;
mod cia402;
mod exchange;
mod frame;
mod link;
mod mit;
mod models;
mod motor;
mod odrive;
mod protocol;
mod rate;
mod robstride;
mod scan;
pub mod slcan;
#[cfg(target_os = "linux")]
pub mod socket;
pub mod udp;

pub use bus::CanBus;
pub use frame::{CanFrame, nominal_bits, worst_bits};
pub use link::{CanFault, CanLink, CanPort, Received, Sent};
pub(crate) use models::CAN_MODELS;
pub use motor::{MotorModel, MotorSettings};
pub(crate) use rate::check_can_rate;
pub use rate::{CycleBits, cycle_bits};
pub use scan::{CanFound, CanScanner};

use crate::error::BusError;

/// Opens the way to a CAN bus that `port` names: see [`CanPort`].
pub fn open_link(port: &str, bitrate: u32) -> Result<Box<dyn CanLink>, BusError> {
    let refused = |reason: String| BusError::Open {
        port: port.into(),
        reason,
        choices: String::new(),
    };
    let opened: std::io::Result<Box<dyn CanLink>> = match CanPort::parse(port).map_err(refused)? {
        CanPort::Slcan(path) => {
            slcan::SlcanLink::open(&path, bitrate).map(|link| Box::new(link) as _)
        }
        CanPort::Udp(group) => udp::UdpLink::open(group).map(|link| Box::new(link) as _),
        #[cfg(target_os = "linux")]
        CanPort::Socket(interface) => {
            socket::SocketLink::open(&interface).map(|link| Box::new(link) as _)
        }
        #[cfg(not(target_os = "linux"))]
        CanPort::Socket(_) => Err(std::io::Error::new(
            std::io::ErrorKind::Unsupported,
            "CAN interfaces need Linux; use a serial adapter, slcan:PATH",
        )),
    };
    opened.map_err(|error| refused(error.to_string()))
}
