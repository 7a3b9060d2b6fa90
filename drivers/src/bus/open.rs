//! From a port and a configuration to an open bus, serial or CAN.

use crate::bus::Bus;
use crate::bus::config::BusConfig;
use crate::bus::port::Port;
use crate::can::CanBus;
use crate::error::{BusError, BusResult};
use crate::ros2::Ros2Bus;
use crate::serial::SerialBus;
use crate::servo::Servo;

/// Opens the bus that a configuration names. Nothing is sent yet.
pub fn open_bus(port: &Port, config: &BusConfig, servos: Vec<Servo>) -> BusResult<Box<dyn Bus>> {
    let refused = |reason| Err(BusError::not_opened(&port.to_string(), reason));
    Ok(match (config.kind, port) {
        (_, Port::Ros2(address)) => Box::new(Ros2Bus::open(address, servos)?),
        (kind, Port::Serial(path)) if !kind.is_can() => {
            Box::new(SerialBus::open(path, config, servos)?)
        }
        (kind, Port::Can(_)) if kind.is_can() => {
            Box::new(CanBus::open(&port.to_string(), config, servos)?)
        }
        (_, Port::Serial(_)) => {
            return refused("the robot file says that this bus is a CAN bus");
        }
        (_, Port::Can(_)) => {
            return refused("the robot file says that this bus is a serial one");
        }
    })
}
