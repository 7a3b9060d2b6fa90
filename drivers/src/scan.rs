//! Who is on a bus: nothing but pings and reads, so safe at any time.
//!
//! For finding servos before there is a robot file, and for checking one.

use std::time::{Duration, Instant};

use dynamixel2::instructions::instruction_id as instruction;
use dynamixel2::instructions::packet_id::BROADCAST;

use crate::error::BusError;
use crate::model::Model;
use crate::packet::Protocol;
use crate::register::{Register, hardware_error_names};
use crate::wire::{Received, Wire};

/// The rates that X series servos can be set to, bits a second.
pub const BAUDS: [u32; 8] = [
    57_600, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000, 115_200, 9_600,
];

/// A servo that answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// The rate at which it answered.
    pub baud: u32,
    /// Its id.
    pub id: u8,
    /// Its model number.
    pub model_number: u16,
    /// The model's name, if it is known here.
    pub model: Option<&'static str>,
    /// Its firmware version.
    pub firmware: u8,
    /// Its hardware errors in words; `None` without any.
    pub hardware_error: Option<String>,
}

/// Pings everyone at one rate with a broadcast, and waits `wait` beyond the
/// time that all 253 answers take on the wire. Servos that answer at the same
/// time (an id given twice) may be missing.
pub fn scan(port: &str, baud: u32, wait: Duration) -> Result<Vec<Found>, BusError> {
    const DOING: &str = "broadcast ping";
    const STATUS_BYTES: usize = 14;
    const LENGTH: usize = 7;
    let mut wire = Wire::open(port, baud, Protocol::Dynamixel2)?;
    wire.send(BROADCAST, instruction::PING, &[], LENGTH, DOING)?;
    let deadline = Instant::now() + wire.time(253 * STATUS_BYTES) + wait;
    let mut found = Vec::new();
    loop {
        match wire.receive(deadline, DOING)? {
            Received::Nothing => break,
            Received::Corrupt => {}
            Received::Packet => {
                let packet = wire.packet();
                if let &[low, high, firmware] = packet.params() {
                    let model_number = u16::from_le_bytes([low, high]);
                    found.push(Found {
                        baud,
                        id: packet.id,
                        model_number,
                        model: Model::from_number(model_number).map(|model| model.name),
                        firmware,
                        hardware_error: packet.alert().then(String::new),
                    });
                }
            }
        }
    }
    for servo in &mut found {
        if servo.hardware_error.is_some() {
            servo.hardware_error = Some(hardware_error(&mut wire, servo.id, wait)?);
        }
    }
    found.sort_by_key(|servo| servo.id);
    Ok(found)
}

/// Pings one id at one rate; `None` if nobody answers within `wait`.
pub fn ping(port: &str, baud: u32, id: u8, wait: Duration) -> Result<Option<Found>, BusError> {
    const DOING: &str = "ping";
    let mut wire = Wire::open(port, baud, Protocol::Dynamixel2)?;
    wire.send(id, instruction::PING, &[], 7, DOING)?;
    let deadline = Instant::now() + wire.time(24) + wait;
    while wire.receive(deadline, DOING)? != Received::Nothing {
        let packet = wire.packet();
        let (alert, from) = (packet.alert(), packet.id);
        if let (true, &[low, high, firmware]) = (from == id, packet.params()) {
            let model_number = u16::from_le_bytes([low, high]);
            let hardware_error = match alert {
                true => Some(hardware_error(&mut wire, id, wait)?),
                false => None,
            };
            return Ok(Some(Found {
                baud,
                id,
                model_number,
                model: Model::from_number(model_number).map(|model| model.name),
                firmware,
                hardware_error,
            }));
        }
    }
    Ok(None)
}

/// The flags behind an alert bit.
fn hardware_error(wire: &mut Wire, id: u8, wait: Duration) -> Result<String, BusError> {
    let register = Register::HARDWARE_ERROR;
    let [a0, a1] = register.address.to_le_bytes();
    let params = [a0, a1, 1, 0];
    wire.send(id, instruction::READ, &params, 5, register.name)?;
    let deadline = Instant::now() + wire.time(26) + wait;
    while wire.receive(deadline, register.name)? != Received::Nothing {
        if let (true, &[flags]) = (wire.packet().id == id, wire.packet().params()) {
            return Ok(hardware_error_names(flags));
        }
    }
    Ok("unknown: the servo did not answer".into())
}
