//! The port of a CAN bus as text: which kind of link, and where.

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CanPort {
    Socket(String),
    Slcan(String),
    /// `fdcanusb:PATH`: mjbots' adapter for CAN FD.
    Fdcanusb(String),
    /// `udp:GROUP:PORT`: an IPv4 multicast group.
    Udp(std::net::SocketAddrV4),
}

impl CanPort {
    /// The kinds of port, for messages.
    pub const KINDS: &str = "can:IFACE, slcan:PATH, fdcanusb:PATH or udp:GROUP:PORT";

    /// The port that a string names; why not, in words.
    pub fn parse(port: &str) -> Result<Self, String> {
        let named = |rest: &str| match rest {
            "" => Err(format!("\"{port}\" names nothing; use {}", Self::KINDS)),
            name => Ok(name.to_owned()),
        };
        match port.split_once(':') {
            Some(("can", rest)) => Ok(Self::Socket(named(rest)?)),
            Some(("slcan", rest)) => Ok(Self::Slcan(named(rest)?)),
            Some(("fdcanusb", rest)) => Ok(Self::Fdcanusb(named(rest)?)),
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
        assert_eq!(CanPort::parse("can:can0"), Ok(CanPort::Socket("can0".into())));
        assert_eq!(CanPort::parse("slcan:/dev/ttyACM0"), Ok(CanPort::Slcan("/dev/ttyACM0".into())));
        assert!(matches!(CanPort::parse("udp:239.74.163.2:43113"), Ok(CanPort::Udp(_))));
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
