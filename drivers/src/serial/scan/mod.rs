//! One servo at a time, before there is a robot: who is on a serial bus, how it
//! is, and which id it has.
//!
//! `sweep.rs` finds everyone, `change.rs` gives ids and rates, `memory.rs` reads and writes
//! the rest.
//!
//! Nothing here turns torque on. Pings and reads are safe at any time;
//! [`SerialScanner::set_id`] turns the servo's torque off first, and
//! [`SerialScanner::write_entry`] refuses permanent memory while torque is on. Every call is bounded
//! by the wire time and the wait that the caller chose, times [`TRIES`].

mod change;
mod memory;
mod sweep;

pub use memory::Readings;

use std::collections::HashMap;
use std::time::{Duration, Instant};

use dynamixel2::instructions::instruction_id as instruction;

use crate::bus::reply_clock::ReplyClock;
use crate::error::{BusError, BusResult, Refusal, ServoId};
use crate::serial::families::FAMILIES;
use crate::serial::family::ServoFamily;
use crate::serial::register::{Register, names_of};
use crate::serial::registers::{Identity, ServiceRegisters};
use crate::serial::wire::framing::Framing;
use crate::serial::wire::port::{PacketPort, Received};
use crate::serial::wire::protocol1::ErrorFlags;
use crate::serial::wire::stale_replies::ServoRequest;
use crate::servo::model::ServoModel;

const TRIES: u32 = 2;

/// Where every family of Protocol 1 says who it is, each in its own order.
const START: Register = Register::new(0, 6, "model");

fn families(
    framing: Framing,
) -> impl Iterator<Item = (&'static dyn ServoFamily, &'static ServiceRegisters)> {
    let of_framing = FAMILIES.iter().filter(move |family| family.framing() == framing);
    of_framing.filter_map(|&family| Some((family, family.registers().service.as_ref()?)))
}

/// What a servo of Protocol 1 says it is, if the beginning of its memory has its id
/// where this family keeps it.
fn recognised(
    family: &dyn ServoFamily,
    service: &ServiceRegisters,
    id: u8,
    start: &[u8],
) -> Option<Identity> {
    let own_id = start.get(service.id.range())?;
    let bytes = start.get(family.identity_register()?.range())?;
    let identity = family.identity(bytes)?;
    (own_id == [id]).then_some(identity)
}

#[allow(missing_docs)] // each field says its name
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundServo {
    pub baud: u32,
    pub id: u8,
    pub model_number: u16,
    pub model: Option<&'static str>,
    pub firmware: u8,
    /// Its hardware errors in words; `None` without any.
    pub hardware_error: Option<String>,
    pub family: &'static dyn ServoFamily,
    service: &'static ServiceRegisters,
}

impl FoundServo {
    /// The highest id that it can be given.
    pub fn last_id(&self) -> u8 {
        self.service.last_id
    }
}

#[allow(missing_docs)] // units stand in the names
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vitals {
    pub voltage_v: f64,
    pub temperature_c: u8,
    pub position_ticks: i32,
    pub torque_enabled: bool,
}

/// A serial port at one rate and one framing.
pub struct SerialScanner {
    port: PacketPort,
    baud: u32,
    wait: Duration,
    /// Whose family is known: it says what an error flag means.
    families: HashMap<u8, &'static dyn ServoFamily>,
}

impl SerialScanner {
    /// The framings that are looked for.
    pub const FRAMINGS: [Framing; 2] = [Framing::Protocol2, Framing::Protocol1];

    /// The rates that servos of a framing can be set to, the usual ones first: the order of
    /// a scan, which no order of a baud register gives.
    pub fn bauds(framing: Framing) -> &'static [u32] {
        match framing {
            Framing::Protocol2 => {
                &[57_600, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000, 115_200, 9_600]
            }
            Framing::Protocol1 => &[
                1_000_000, 57_600, 500_000, 115_200, 250_000, 200_000, 128_000, 76_800, 38_400,
                19_200, 9_600,
            ],
        }
    }

    /// Opens `port`. `wait` is how long a servo may take to answer beyond the time on the wire.
    pub fn open(port: &str, baud: u32, framing: Framing, wait: Duration) -> BusResult<Self> {
        let port = PacketPort::open(port, baud, framing, ReplyClock::Wall)?;
        Ok(Self { port, baud, wait, families: HashMap::new() })
    }

    /// Before a servo is spoken to that another scanner may have found.
    fn know(&mut self, servo: &FoundServo) {
        self.families.insert(servo.id, servo.family);
    }

    /// Asks one id; `None` if nobody answers.
    pub fn ping(&mut self, id: u8) -> BusResult<Option<FoundServo>> {
        self.ping_tries(id, TRIES)
    }

    fn ping_tries(&mut self, id: u8, tries: u32) -> BusResult<Option<FoundServo>> {
        let reply = self.port.framing().ping_params();
        self.families.remove(&id); // it may be another servo than before
        let answer = self.ask(id, instruction::PING, &[], reply, "ping", tries)?;
        match answer {
            Some((flags, params)) => self.identify(id, flags, &params),
            None => Ok(None),
        }
    }

    fn identify(&mut self, id: u8, flags: u8, answer: &[u8]) -> BusResult<Option<FoundServo>> {
        let known = match self.port.framing() {
            Framing::Protocol2 => families(Framing::Protocol2)
                .find_map(|(family, service)| Some((family, service, family.identity(answer)?))),
            Framing::Protocol1 => self.read_bytes(id, START)?.and_then(|start| {
                let families: Vec<_> = families(Framing::Protocol1).collect();
                families.into_iter().rev().find_map(|(family, service)| {
                    let identity = recognised(family, service, id, &start)?;
                    Some((family, service, identity))
                })
            }),
        };
        let Some((family, service, identity)) = known else {
            return Ok(None);
        };
        self.families.insert(id, family);
        let mut found = FoundServo {
            baud: self.baud,
            id,
            model_number: identity.model_number,
            model: ServoModel::from_number(identity.model_number).map(|model| model.name),
            firmware: identity.firmware,
            hardware_error: None,
            family,
            service,
        };
        let error = match self.port.framing() {
            Framing::Protocol2 => flags,
            Framing::Protocol1 => family.error_flags().error_of(flags),
        };
        if error & 0x80 != 0 {
            let flags = match service.status {
                Some(register) => self.read(id, register)?,
                None => None,
            };
            let words = flags.map(|flags| names_of(flags as u8, family.conditions()));
            found.hardware_error = Some(words.unwrap_or_else(|| "not told".into()));
        }
        Ok(Some(found))
    }

    /// How a servo is; `None` if it falls silent.
    pub fn vitals(&mut self, servo: &FoundServo) -> BusResult<Option<Vitals>> {
        self.know(servo);
        let service = servo.service;
        let mut values = [0; 4];
        let registers = [
            service.voltage,
            service.temperature,
            service.position,
            servo.family.registers().torque,
        ];
        for (value, register) in values.iter_mut().zip(registers) {
            match self.read(servo.id, register)? {
                Some(read) => *value = read,
                None => return Ok(None),
            }
        }
        let [voltage, temperature, position, torque] = values;
        Ok(Some(Vitals {
            voltage_v: voltage as f64 * 0.1,
            temperature_c: temperature as u8,
            position_ticks: servo.family.ticks(position),
            torque_enabled: torque != 0,
        }))
    }

    /// Turns a servo's torque off and reads it back.
    pub fn torque_off(&mut self, servo: &FoundServo) -> BusResult<()> {
        self.know(servo);
        self.set(servo.id, servo.family.registers().torque, 0)
    }

    /// Reads a register; `None` if nobody answers.
    pub fn read(&mut self, id: u8, register: Register) -> BusResult<Option<u64>> {
        let bytes = self.read_bytes(id, register)?;
        Ok(bytes.map(|bytes| register.value(&bytes)))
    }

    fn read_bytes(&mut self, id: u8, register: Register) -> BusResult<Option<Vec<u8>>> {
        let params = self.port.framing().read_params(register);
        let size = usize::from(register.size);
        let read = instruction::READ;
        let answer = self.ask(id, read, &params, size, register.name, TRIES)?;
        Ok(answer.map(|(_, bytes)| bytes))
    }

    fn read_once(&mut self, id: u8, register: Register) -> BusResult<Option<Vec<u8>>> {
        let params = self.port.framing().read_params(register);
        let size = usize::from(register.size);
        let answer = self.ask(id, instruction::READ, &params, size, register.name, 1)?;
        Ok(answer.map(|(_, bytes)| bytes))
    }

    /// Writes a register; the servo must confirm.
    fn write(&mut self, id: u8, register: Register, value: u64) -> BusResult<()> {
        let params = self.port.framing().write_params(register, value);
        let write = instruction::WRITE;
        match self.ask(id, write, &params, 0, register.name, TRIES)? {
            Some(_) => Ok(()),
            None => Err(silent(id, register.name)),
        }
    }

    /// Writes a register and reads it back.
    pub fn set(&mut self, id: u8, register: Register, value: u64) -> BusResult<()> {
        self.write(id, register, value)?;
        match self.read(id, register)? {
            Some(actual) if actual == value => Ok(()),
            Some(actual) => Err(BusError::ReadBack {
                servo: nameless(id),
                register: register.name,
                wanted: value as i64,
                actual: actual as i64,
            }),
            None => Err(silent(id, register.name)),
        }
    }

    fn send_write(&mut self, id: u8, register: Register, value: u64) -> BusResult<()> {
        let params = self.port.framing().write_params(register, value);
        match self.ask(id, instruction::WRITE, &params, 0, register.name, 1) {
            Err(BusError::Corrupt { .. }) | Ok(_) => Ok(()),
            Err(error) => Err(error),
        }
    }

    /// One instruction to one id: error flags and parameters of its answer, `None` if nobody answers.
    fn ask(
        &mut self,
        id: u8,
        instruction: u8,
        params: &[u8],
        reply: usize,
        doing: &'static str,
        tries: u32,
    ) -> BusResult<Option<(u8, Vec<u8>)>> {
        // While nobody knows whose flags they are, an answer that came whole is one.
        let family = self.families.get(&id);
        let meaning = family.map_or(ErrorFlags::Conditions, |family| family.error_flags());
        self.port.read_flags_as(meaning);
        let request = ServoRequest { id, instruction, params, reply };
        let bytes = 2 * self.port.framing().status_bytes() + params.len() + reply;
        let wait = self.port.time(bytes) + self.wait;
        let mut corrupt = false;
        for _ in 0..tries {
            self.port.ask(&request, wait, doing)?;
            let deadline = Instant::now() + wait;
            loop {
                match self.port.receive(deadline, doing)? {
                    Received::Nothing => {
                        self.port.note_unanswered(&request);
                        break;
                    }
                    Received::Corrupt => corrupt = true,
                    Received::Packet => {
                        let packet = self.port.packet();
                        if packet.id != id {
                            continue;
                        }
                        match Refusal(packet.error()) {
                            Refusal(0) if packet.params().len() == reply => {
                                return Ok(Some((packet.flags(), packet.params().to_vec())));
                            }
                            Refusal(0) | Refusal::CRC => corrupt = true,
                            refusal => {
                                return Err(BusError::Refused {
                                    servo: nameless(id),
                                    doing,
                                    refusal,
                                });
                            }
                        }
                    }
                }
            }
        }
        if corrupt {
            return Err(BusError::Corrupt { servos: vec![nameless(id)], doing, tries });
        }
        Ok(None)
    }
}

fn nameless(id: u8) -> ServoId {
    ServoId { joint: "servo".into(), id }
}

fn silent(id: u8, doing: &'static str) -> BusError {
    BusError::Silent { servos: vec![nameless(id)], doing, tries: TRIES, hint: String::new() }
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::os::unix::net::{UnixListener, UnixStream};

    const PATIENCE: Duration = Duration::from_millis(200);
    const FIRST: u8 = 48;

    #[test]
    fn protocol_1_families_are_told_apart_by_where_their_id_is() {
        // STS3215, id 7; AX-12, id 7; MX-28, id 7 with a return delay of 0.
        for (start, found) in [
            ([3, 10, 0, 9, 3, 7], &["Feetech STS"][..]),
            ([12, 0, 24, 7, 1, 250], &["Dynamixel 1"]),
            ([29, 0, 40, 7, 34, 0], &["Dynamixel 1"]),
            ([0; 6], &[]),
        ] {
            let known = families(Framing::Protocol1);
            let known = known.filter_map(|(family, service)| {
                recognised(family, service, 7, &start).map(|identity| (family.name(), identity))
            });
            let known: Vec<_> = known.collect();
            let names: Vec<_> = known.iter().map(|(name, _)| *name).collect();
            assert_eq!(names, found);
        }
        let ax = recognised(
            &crate::serial::dynamixel1::Dynamixel1,
            service_of_ax(),
            7,
            &[12, 0, 24, 7, 1, 250],
        );
        let ax = ax.unwrap();
        assert_eq!((ax.model_number, ax.firmware), (12, 24));
    }

    fn service_of_ax() -> &'static ServiceRegisters {
        families(Framing::Protocol1).next().unwrap().1
    }

    /// A servo whose registers hold their own addresses, and that answers the
    /// first question only when it has been asked twice.
    fn answer_late_once(mut host: UnixStream) -> std::io::Result<()> {
        const ADDRESS: usize = 8;
        let mut question = [0; 14];
        host.read_exact(&mut question)?;
        loop {
            host.read_exact(&mut question)?;
            let mut status = Vec::new();
            let params = [0, question[ADDRESS], 0, 0, 0];
            Framing::Protocol2.encode(&mut status, question[4], 0x55, &params);
            host.write_all(&status)?;
            if question[ADDRESS] == FIRST {
                std::thread::sleep(PATIENCE / 20);
                host.write_all(&status)?;
            }
        }
    }

    #[test]
    fn a_late_answer_is_not_taken_for_that_of_the_next_question() {
        let path = std::env::temp_dir().join(format!("probe-late-{}", std::process::id()));
        let listener = UnixListener::bind(&path).unwrap();
        let port = path.to_str().unwrap();
        let mut probe = SerialScanner::open(port, 1_000_000, Framing::Protocol2, PATIENCE).unwrap();
        std::fs::remove_file(&path).unwrap();
        let servo = listener.accept().unwrap().0;
        std::thread::spawn(move || answer_late_once(servo));
        for address in [FIRST, 52, 20, 36] {
            let register = Register::new(address.into(), 4, "own address");
            assert_eq!(probe.read(7, register).unwrap(), Some(address.into()));
        }
    }
}
