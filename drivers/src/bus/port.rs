//! Where a bus is plugged in: the text after `--bus`.
//!
//! `serial:/dev/ttyUSB0`, or a way to CAN ([`CanPort`]). Anything else is
//! refused with the choices.

use std::fmt;
use std::str::FromStr;

use crate::can::CanPort;
use crate::error::ConfigError;

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Port {
    Serial(String),
    Can(CanPort),
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
            _ => Err(ConfigError::Port {
                actual: text.into(),
                reason: format!("choose serial:PATH, {}", CanPort::KINDS),
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
