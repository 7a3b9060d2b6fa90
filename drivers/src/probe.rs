//! One servo at a time, before there is a robot: who is on a serial bus, how it
//! is, and which id it has.
//!
//! Nothing here turns torque on. Pings and reads are safe at any time;
//! [`Probe::set_id`] turns the servo's torque off first. Every call is bounded
//! by the wire time and the wait that the caller chose, times [`TRIES`].

use std::time::{Duration, Instant};

use dynamixel2::instructions::instruction_id as instruction;
use dynamixel2::instructions::packet_id::BROADCAST;

use crate::error::{BusError, Refusal, ServoId};
use crate::family::Family;
use crate::model::Model;
use crate::owed::Question;
use crate::packet::Protocol;
use crate::register::Register;
use crate::reply_clock::ReplyClock;
use crate::wire::{Received, Wire};

/// How often a question is asked before its answer counts as missing.
const TRIES: u32 = 2;
/// How long each id may wait for its turn to answer a broadcast.
const BROADCAST_TURN: Duration = Duration::from_millis(3);

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
    /// Where its memory has what.
    pub family: Family,
}

/// How a servo is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vitals {
    /// Supply, volts.
    pub voltage_v: f64,
    /// Temperature, Celsius.
    pub temperature_c: u8,
    /// Where it stands, encoder ticks.
    pub position_ticks: i32,
    /// Whether it holds that position with force.
    pub torque_enabled: bool,
}

/// A serial port at one rate and one framing.
pub struct Probe {
    wire: Wire,
    baud: u32,
    wait: Duration,
}

impl Probe {
    /// The framings that are looked for.
    pub const PROTOCOLS: [Protocol; 2] = [Protocol::Dynamixel2, Protocol::Protocol1];

    /// The rates that servos of a protocol can be set to, the usual ones first.
    pub fn bauds(protocol: Protocol) -> &'static [u32] {
        match protocol {
            Protocol::Dynamixel2 => &[
                57_600, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000, 115_200, 9_600,
            ],
            Protocol::Protocol1 => &[
                1_000_000, 57_600, 500_000, 115_200, 250_000, 200_000, 128_000, 76_800, 38_400,
                19_200, 9_600,
            ],
        }
    }

    /// Opens `port`. `wait` is how long a servo may take to answer beyond the
    /// time on the wire.
    pub fn open(
        port: &str,
        baud: u32,
        protocol: Protocol,
        wait: Duration,
    ) -> Result<Self, BusError> {
        Ok(Self {
            wire: Wire::open(port, baud, protocol, ReplyClock::Wall)?,
            baud,
            wait,
        })
    }

    /// What keeps the adapter slow, if anything does.
    pub fn latency_note(&self) -> Option<String> {
        self.wire.latency_note()
    }

    /// Everyone who answers, by id. Protocol 2.0 is asked with one broadcast; if
    /// answers came damaged (an id given twice), and in Protocol 1, every id is
    /// asked by itself.
    pub fn everyone(&mut self) -> Result<Vec<Found>, BusError> {
        let mut found = match self.wire.protocol() {
            Protocol::Dynamixel2 => match self.broadcast_ping()? {
                Some(found) => found,
                None => self.sweep()?,
            },
            Protocol::Protocol1 => self.sweep()?,
        };
        found.sort_by_key(|servo| servo.id);
        Ok(found)
    }

    /// Asks every id once, and where somebody lives the silent ones once more: a
    /// rate that nobody uses takes no longer for it.
    fn sweep(&mut self) -> Result<Vec<Found>, BusError> {
        let mut found = Vec::new();
        let mut silent: Vec<u8> = (0..BROADCAST).collect();
        for _ in 0..TRIES {
            let mut still = Vec::new();
            for id in silent {
                match self.ping_tries(id, 1) {
                    Ok(Some(servo)) => found.push(servo),
                    Ok(None) => still.push(id),
                    Err(BusError::Corrupt { .. }) => found.push(self.unreadable(id)),
                    Err(error) => return Err(error),
                }
            }
            silent = still;
            if found.is_empty() {
                break;
            }
        }
        Ok(found)
    }

    /// Somebody answers there, but nobody can make out what.
    fn unreadable(&self, id: u8) -> Found {
        Found {
            baud: self.baud,
            id,
            model_number: 0,
            model: None,
            firmware: 0,
            hardware_error: Some("only damaged answers: is this id given twice?".into()),
            family: match self.wire.protocol() {
                Protocol::Dynamixel2 => Family::X,
                Protocol::Protocol1 => Family::Ax,
            },
        }
    }

    /// `None` if an answer came damaged.
    fn broadcast_ping(&mut self) -> Result<Option<Vec<Found>>, BusError> {
        const DOING: &str = "broadcast ping";
        const STATUS_BYTES: usize = 14;
        self.wire
            .send(BROADCAST, instruction::PING, &[], 7, DOING)?;
        let turns = self.wire.time(253 * STATUS_BYTES) + 253 * BROADCAST_TURN;
        let deadline = Instant::now() + turns + self.wait;
        let mut answers = Vec::new();
        let mut damaged = false;
        loop {
            match self.wire.receive(deadline, DOING)? {
                Received::Nothing if damaged => return Ok(None),
                Received::Nothing => break,
                Received::Corrupt => damaged = true,
                Received::Packet => {
                    let packet = self.wire.packet();
                    answers.push((packet.id, packet.alert(), packet.params().to_vec()));
                }
            }
        }
        let found = answers.into_iter();
        found
            .map(|(id, alert, params)| self.identify(id, alert, &params))
            .collect::<Result<Vec<_>, _>>()
            .map(|found| Some(found.into_iter().flatten().collect()))
    }

    /// Asks one id; `None` if nobody answers.
    pub fn ping(&mut self, id: u8) -> Result<Option<Found>, BusError> {
        self.ping_tries(id, TRIES)
    }

    fn ping_tries(&mut self, id: u8, tries: u32) -> Result<Option<Found>, BusError> {
        let reply = self.wire.protocol().ping_params();
        let answer = self.ask(id, instruction::PING, &[], reply, "ping", tries)?;
        match answer {
            Some((alert, params)) => self.identify(id, alert, &params),
            None => Ok(None),
        }
    }

    /// Who it is that answered a ping.
    fn identify(&mut self, id: u8, alert: bool, answer: &[u8]) -> Result<Option<Found>, BusError> {
        let known = match *answer {
            [low, high, firmware] => Some((Family::X, u16::from_le_bytes([low, high]), firmware)),
            _ => {
                const START: Register = Register {
                    address: 0,
                    size: 6,
                    name: "model",
                };
                let start = self.read_bytes(id, START)?;
                start.and_then(|bytes| Family::of_protocol1(id, &bytes))
            }
        };
        let Some((family, model_number, firmware)) = known else {
            return Ok(None);
        };
        let mut found = Found {
            baud: self.baud,
            id,
            model_number,
            model: Model::from_number(model_number).map(|model| model.name),
            firmware,
            hardware_error: None,
            family,
        };
        if alert {
            let flags = match family.layout().status {
                Some(register) => self.read(id, register)?,
                None => None,
            };
            let words = flags.map(|flags| family.error_names(flags as u8));
            found.hardware_error = Some(words.unwrap_or_else(|| "not told".into()));
        }
        Ok(Some(found))
    }

    /// How a servo is; `None` if it falls silent.
    pub fn vitals(&mut self, servo: &Found) -> Result<Option<Vitals>, BusError> {
        let layout = servo.family.layout();
        let mut values = [0; 4];
        let registers = [
            layout.voltage,
            layout.temperature,
            layout.position,
            layout.torque,
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
            position_ticks: servo.family.position_ticks(position),
            torque_enabled: torque != 0,
        }))
    }

    /// Turns a servo's torque off and reads it back.
    pub fn torque_off(&mut self, servo: &Found) -> Result<(), BusError> {
        self.set(servo.id, servo.family.layout().torque, 0)
    }

    /// Gives a servo another id, in its permanent memory: torque off first, the
    /// id read back where it then answers. The caller has looked that `id` is
    /// free.
    pub fn set_id(&mut self, servo: &Found, id: u8) -> Result<(), BusError> {
        let layout = servo.family.layout();
        self.torque_off(servo)?;
        if let Some(lock) = layout.lock {
            self.write(servo.id, lock, 0)?;
        }
        // Some firmware confirms from the old id, some from the new one, some
        // not at all: the id that is read back decides.
        self.send_write(servo.id, layout.id, u64::from(id))?;
        let actual = self.read(id, layout.id)?;
        if actual != Some(u64::from(id)) {
            return Err(silent(id, layout.id.name));
        }
        match layout.lock {
            Some(lock) => self.write(id, lock, 1),
            None => Ok(()),
        }
    }

    /// Reads a register; `None` if nobody answers.
    pub fn read(&mut self, id: u8, register: Register) -> Result<Option<u64>, BusError> {
        let bytes = self.read_bytes(id, register)?;
        Ok(bytes.map(|bytes| register.value(&bytes)))
    }

    fn read_bytes(&mut self, id: u8, register: Register) -> Result<Option<Vec<u8>>, BusError> {
        let mut params = Vec::with_capacity(4);
        let protocol = self.wire.protocol();
        protocol.put_number(&mut params, register.address);
        protocol.put_number(&mut params, register.size);
        let size = usize::from(register.size);
        let read = instruction::READ;
        let answer = self.ask(id, read, &params, size, register.name, TRIES)?;
        Ok(answer.map(|(_, bytes)| bytes))
    }

    /// Writes a register; the servo must confirm.
    fn write(&mut self, id: u8, register: Register, value: u64) -> Result<(), BusError> {
        let params = self.write_params(register, value);
        let write = instruction::WRITE;
        match self.ask(id, write, &params, 0, register.name, TRIES)? {
            Some(_) => Ok(()),
            None => Err(silent(id, register.name)),
        }
    }

    /// Writes a register and reads it back.
    fn set(&mut self, id: u8, register: Register, value: u64) -> Result<(), BusError> {
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

    /// Writes a register; no answer is an answer, a refusal is not.
    fn send_write(&mut self, id: u8, register: Register, value: u64) -> Result<(), BusError> {
        let params = self.write_params(register, value);
        match self.ask(id, instruction::WRITE, &params, 0, register.name, 1) {
            Err(BusError::Corrupt { .. }) | Ok(_) => Ok(()),
            Err(error) => Err(error),
        }
    }

    fn write_params(&self, register: Register, value: u64) -> Vec<u8> {
        let mut params = Vec::with_capacity(6);
        self.wire
            .protocol()
            .put_number(&mut params, register.address);
        params.extend(&value.to_le_bytes()[..usize::from(register.size)]);
        params
    }

    /// One instruction to one id: alert bit and parameters of its answer, `None`
    /// if nobody answers.
    fn ask(
        &mut self,
        id: u8,
        instruction: u8,
        params: &[u8],
        reply: usize,
        doing: &'static str,
        tries: u32,
    ) -> Result<Option<(bool, Vec<u8>)>, BusError> {
        let question = Question {
            id,
            instruction,
            params,
            reply,
        };
        let bytes = 2 * self.wire.protocol().status_bytes() + params.len() + reply;
        let wait = self.wire.time(bytes) + self.wait;
        let mut corrupt = false;
        for _ in 0..tries {
            self.wire.ask(&question, wait, doing)?;
            let deadline = Instant::now() + wait;
            loop {
                match self.wire.receive(deadline, doing)? {
                    Received::Nothing => {
                        self.wire.note_unanswered(&question);
                        break;
                    }
                    Received::Corrupt => corrupt = true,
                    Received::Packet => {
                        let packet = self.wire.packet();
                        if packet.id != id {
                            continue;
                        }
                        match Refusal(packet.error()) {
                            Refusal(0) if packet.params().len() == reply => {
                                return Ok(Some((packet.alert(), packet.params().to_vec())));
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
            return Err(BusError::Corrupt {
                servos: vec![nameless(id)],
                doing,
                tries,
            });
        }
        Ok(None)
    }
}

fn nameless(id: u8) -> ServoId {
    ServoId {
        joint: "servo".into(),
        id,
    }
}

fn silent(id: u8, doing: &'static str) -> BusError {
    BusError::Silent {
        servos: vec![nameless(id)],
        doing,
        tries: TRIES,
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::os::unix::net::{UnixListener, UnixStream};

    const PATIENCE: Duration = Duration::from_millis(200);
    const FIRST: u8 = 48;

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
            Protocol::Dynamixel2.encode(&mut status, question[4], 0x55, &params);
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
        let mut probe = Probe::open(port, 1_000_000, Protocol::Dynamixel2, PATIENCE).unwrap();
        std::fs::remove_file(&path).unwrap();
        let servo = listener.accept().unwrap().0;
        std::thread::spawn(move || answer_late_once(servo));
        for address in [FIRST, 52, 20, 36] {
            let register = Register {
                address: address.into(),
                size: 4,
                name: "own address",
            };
            assert_eq!(probe.read(7, register).unwrap(), Some(address.into()));
        }
    }
}
