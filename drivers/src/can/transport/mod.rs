//! Ways to a CAN bus, and the frames that travel on it.
//!
//! | port | what it is |
//! |---|---|
//! | `can:IFACE` | a CAN interface of the system (SocketCAN, Linux only), with CAN FD where it has it; bitrate set by the system |
//! | `slcan:PATH` | a serial CAN adapter that speaks the ASCII protocol of LAWICEL |
//! | `fdcanusb:PATH` | mjbots' serial adapter, which carries CAN FD |
//! | `udp:GROUP:PORT` | frames as multicast datagrams, as python-can's `udp_multicast` does: for simulation |
//!
//! A new way implements [`CanLink`] and gets its line in `open_link`.

#[doc(hidden)]
pub mod fdcanusb;
mod frame;
mod line_port;
mod link;
mod port;
// The simulated adapters speak the same protocols; nobody else needs these modules.
#[doc(hidden)]
pub mod slcan;
#[cfg(target_os = "linux")]
#[doc(hidden)]
pub mod socket;
#[doc(hidden)]
pub mod udp;

pub use frame::CanFrame;
pub(crate) use frame::{flexible_bits, nominal_bits, word, worst_bits};
pub use link::{CanEvent, CanFault, CanLink, Sent};
pub use port::CanPort;

use crate::error::{BusError, BusResult};

/// Opens the way to a CAN bus that `port` names: see [`CanPort`].
pub(crate) fn open_link(port: &str, bitrate: u32) -> BusResult<Box<dyn CanLink>> {
    let refused = |reason: String| BusError::not_opened(port, reason);
    let opened: std::io::Result<Box<dyn CanLink>> = match CanPort::parse(port).map_err(refused)? {
        CanPort::Slcan(path) => {
            slcan::SlcanLink::open(&path, bitrate).map(|link| Box::new(link) as _)
        }
        CanPort::Fdcanusb(path) => {
            fdcanusb::FdcanusbLink::open(&path).map(|link| Box::new(link) as _)
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
