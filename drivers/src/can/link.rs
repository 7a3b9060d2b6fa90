//! The ways to a CAN bus: one trait, and which kind a port names.
//!
//! | port | what it is |
//! |---|---|
//! | `can:IFACE` | a CAN interface of the system (SocketCAN, Linux only), bitrate set by the system |
//! | `slcan:PATH` | a serial CAN adapter that speaks the ASCII protocol of LAWICEL |
//! | `udp:GROUP:PORT` | frames as multicast datagrams, as python-can's `udp_multicast` does: for simulation |
//!
//! A link moves frames and says what the controller reports; it does not wait
//! for anything but its deadline, does not try again, and knows no motors.

use std::io;
use std::time::Instant;

use crate::can::frame::CanFrame;

/// What became of a frame that was to be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sent {
    /// The controller or adapter took it.
    Taken,
    /// No room in the transmit queue (ENOBUFS): nothing was sent, try again
    /// when a frame's time has passed.
    Full,
}

/// What came in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A frame.
    Frame(CanFrame),
    /// The controller reports a fault of the bus.
    Fault(CanFault),
    /// Nothing within the deadline.
    Nothing,
}

/// What a controller reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanFault {
    /// Error counters are high (warning level).
    Warning,
    /// The controller may no longer disturb others: it is close to bus-off.
    Passive,
    /// A damaged frame was seen, or nobody acknowledged one.
    Error,
    /// Frames came faster than they were fetched; some are lost.
    Overrun,
    /// The adapter refused or lost a frame that it was to send.
    Rejected,
    /// The controller has left the bus. Nothing gets through until it restarts.
    BusOff,
}

/// A way to a CAN bus. Opened for this program; closed when dropped.
pub trait CanLink: Send {
    /// Offers one frame. Blocks for no longer than handing it over takes. A link
    /// may keep it until the next `receive`, to hand several over at once.
    fn send(&mut self, frame: &CanFrame) -> io::Result<Sent>;

    /// Hands over what it has kept, as far as there is room.
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }

    /// The next frame or fault, waiting until `deadline` at most; with a
    /// deadline in the past, what is there already.
    fn receive(&mut self, deadline: Instant) -> io::Result<Received>;

    /// Throws away what came in and was not fetched.
    fn clear(&mut self) -> io::Result<()>;
}

/// Where a port string leads.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CanPort {
    /// A network interface of the system.
    Socket(String),
    /// A serial adapter: its path.
    Slcan(String),
    /// A multicast group.
    Udp(std::net::SocketAddrV4),
}

impl CanPort {
    /// The kinds of port, for messages.
    pub const KINDS: &str = "can:IFACE, slcan:PATH or udp:GROUP:PORT";

    /// The port that a string names; why not, in words.
    pub fn parse(port: &str) -> Result<Self, String> {
        let named = |rest: &str| match rest {
            "" => Err(format!("\"{port}\" names nothing; use {}", Self::KINDS)),
            name => Ok(name.to_owned()),
        };
        match port.split_once(':') {
            Some(("can", rest)) => Ok(Self::Socket(named(rest)?)),
            Some(("slcan", rest)) => Ok(Self::Slcan(named(rest)?)),
            Some(("udp", rest)) => match rest.parse::<std::net::SocketAddrV4>() {
                Ok(address) if address.ip().is_multicast() && address.port() != 0 => {
                    Ok(Self::Udp(address))
                }
                _ => Err(format!(
                    "\"{rest}\" is not an IPv4 multicast group and port, e.g. 239.74.163.2:43113"
                )),
            },
            _ => Err(format!("unknown kind of CAN port; use {}", Self::KINDS)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_told_apart_and_bad_ones_explained() {
        assert_eq!(
            CanPort::parse("can:can0"),
            Ok(CanPort::Socket("can0".into()))
        );
        assert_eq!(
            CanPort::parse("slcan:/dev/ttyACM0"),
            Ok(CanPort::Slcan("/dev/ttyACM0".into()))
        );
        assert!(matches!(
            CanPort::parse("udp:239.74.163.2:43113"),
            Ok(CanPort::Udp(_))
        ));
        for (port, says) in [
            ("/dev/ttyUSB0", "unknown kind"),
            ("can:", "names nothing"),
            ("udp:127.0.0.1:5", "not an IPv4 multicast group"),
            ("udp:239.0.0.1:0", "not an IPv4 multicast group"),
            ("", "unknown kind"),
        ] {
            let reason = CanPort::parse(port).unwrap_err();
            assert!(reason.contains(says), "{port}: {reason}");
        }
    }
}
