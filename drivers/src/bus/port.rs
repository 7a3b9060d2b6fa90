//! Where a bus is plugged in: the text after `--bus`.
//!
//! `serial:/dev/ttyUSB0`, a way to CAN ([`CanPort`]), or a controller on ROS 2
//! (`ros2:HOST:PORT`). Anything else is refused with the choices.

use std::fmt;
use std::str::FromStr;

use crate::can::CanPort;
use crate::error::ConfigError;
use crate::ros2::Ros2Address;

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Port {
    Serial(String),
    Can(CanPort),
    /// A controller that listens on ROS 2, through rosbridge.
    Ros2(Ros2Address),
}

impl FromStr for Port {
    type Err = ConfigError;

    fn from_str(text: &str) -> Result<Self, ConfigError> {
        match text.split_once(':') {
            Some(("serial", path)) if !path.is_empty() => Ok(Self::Serial(path.into())),
            Some(("can" | "slcan" | "fdcanusb" | "udp", _)) => match CanPort::parse(text) {
                Ok(port) => Ok(Self::Can(port)),
                Err(reason) => Err(ConfigError::Port { actual: text.into(), reason }),
            },
            Some(("ros2", address)) => match Ros2Address::parse(address) {
                Ok(address) => Ok(Self::Ros2(address)),
                Err(reason) => Err(ConfigError::Port { actual: text.into(), reason }),
            },
            _ => Err(ConfigError::Port {
                actual: text.into(),
                reason: format!("choose serial:PATH, {}, ros2:HOST:PORT", CanPort::KINDS),
            }),
        }
    }
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial(path) => write!(f, "serial:{path}"),
            Self::Can(CanPort::Socket(interface)) => write!(f, "can:{interface}"),
            Self::Can(CanPort::Slcan(path)) => write!(f, "slcan:{path}"),
            Self::Can(CanPort::Fdcanusb(path)) => write!(f, "fdcanusb:{path}"),
            Self::Can(CanPort::Udp(address)) => write!(f, "udp:{address}"),
            Self::Ros2(address) => write!(f, "ros2:{address}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_read_and_written_alike() {
        for text in [
            "serial:/dev/ttyUSB0",
            "can:can0",
            "slcan:/dev/ttyACM0",
            "fdcanusb:/dev/ttyACM0",
            "udp:239.74.163.2:43113",
            "ros2:g1.local:9090",
            "ros2:127.0.0.1:9090/left",
        ] {
            assert_eq!(text.parse::<Port>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn an_unknown_port_lists_the_choices() {
        for text in ["", "serial", "serial:", "usb:1", "can"] {
            let error = text.parse::<Port>().unwrap_err().to_string();
            assert!(error.contains("serial:PATH"), "{error}");
        }
    }
}
