//! Exchanges with the servos of one serial bus, whatever the protocol's framing.
//!
//! Instructions, retries, read-back, and the name of who is to blame. Every
//! exchange is bounded: wire time, return delay and the reply timeout, times
//! the tries. Nothing here knows what the registers mean.

mod checks;

use std::time::{Duration, Instant};

use dynamixel2::instructions::instruction_id as instruction;
use dynamixel2::instructions::packet_id::BROADCAST;

use crate::config::BusConfig;
use crate::error::{BusError, ConfigError, Refusal, ServoId};
use crate::owed::Question;
use crate::packet::Protocol;
use crate::register::Register;
use crate::servo::{Servo, check_kind};
use crate::wire::{Received, Wire};

/// Return delay that a servo has before it is set to zero: 254 units of 2 us.
const LONGEST_RETURN_DELAY: Duration = Duration::from_micros(508);

/// One serial bus and who is on it.
pub struct Link {
    /// The port.
    pub wire: Wire,
    /// The servos, in the order of targets and states.
    pub servos: Vec<Servo>,
    /// The checked configuration.
    pub config: BusConfig,
    /// How often an exchange is tried; less while it is known that servos are silent.
    tries: u32,
    /// Parameters of the packet being built.
    params: Vec<u8>,
    /// Which servos gave their part of the read that is going on.
    pub answered: Vec<bool>,
    /// Servos that are left out of cycles: lost, and not back yet.
    pub aside: Vec<bool>,
    /// The error byte of the last answer to [`Link::transfer`], as it came.
    pub flags: u8,
}

impl Link {
    /// Opens the port. Nothing is sent.
    pub fn open(
        port: &str,
        config: &BusConfig,
        servos: Vec<Servo>,
        protocol: Protocol,
    ) -> Result<Self, BusError> {
        let refused = |reason: String| BusError::Open {
            port: port.into(),
            reason,
            choices: String::new(),
        };
        let checked = config.clone().checked();
        let config = checked.map_err(|error: ConfigError| refused(error.to_string()))?;
        check_kind(&servos, config.kind).map_err(refused)?;
        Ok(Self {
            wire: Wire::open(port, config.baud, protocol, config.reply_clock.clone())?,
            answered: vec![false; servos.len()],
            aside: vec![false; servos.len()],
            flags: 0,
            params: Vec::with_capacity(8 + 5 * servos.len()),
            servos,
            tries: config.retries + 1,
            config,
        })
    }

    /// How often an exchange is tried.
    pub fn tries(&self) -> u32 {
        self.tries
    }

    /// Who is at `index`.
    pub fn id_of(&self, index: usize) -> ServoId {
        ServoId::of(&self.servos[index])
    }

    /// Who is at these indices.
    pub fn ids_of(&self, indices: &[usize]) -> Vec<ServoId> {
        indices.iter().map(|&index| self.id_of(index)).collect()
    }

    /// When a reply of `bytes` from `servos` servos to what was just sent must
    /// be there.
    pub fn deadline(&self, bytes: usize, servos: usize) -> Instant {
        Instant::now() + self.wait(bytes, servos)
    }

    /// How long such a reply may take.
    fn wait(&self, bytes: usize, servos: usize) -> Duration {
        self.wire.time(self.wire.sent() + bytes)
            + LONGEST_RETURN_DELAY * servos as u32
            + Duration::from_secs_f64(self.config.reply_timeout_ms * 1e-3)
    }

    /// One instruction to one servo and its status packet, with `self.tries`.
    pub fn transfer(
        &mut self,
        index: usize,
        instruction: u8,
        params: &[u8],
        reply: usize,
        doing: &'static str,
    ) -> Result<Vec<u8>, BusError> {
        let id = self.servos[index].id;
        let question = Question {
            id,
            instruction,
            params,
            reply,
        };
        let bytes = self.wire.protocol().status_bytes() + reply;
        let mut corrupt = false;
        for attempt in 0..self.tries {
            self.wire.stats.retries += u64::from(attempt > 0);
            self.wire.ask(&question, self.wait(bytes, 1), doing)?;
            let deadline = self.deadline(bytes, 1);
            loop {
                match self.wire.receive(deadline, doing)? {
                    Received::Packet => {
                        let packet = self.wire.packet();
                        if packet.id != id {
                            continue;
                        }
                        // The servo heard a damaged instruction: say it again.
                        if packet.error() == Refusal::CRC.0 {
                            self.wire.stats.crc_errors += 1;
                            corrupt = true;
                            break;
                        }
                        if packet.error() != 0 {
                            return Err(BusError::Refused {
                                servo: self.id_of(index),
                                doing,
                                refusal: Refusal(packet.error()),
                            });
                        }
                        if packet.params().len() == reply {
                            self.flags = packet.flags();
                            return Ok(packet.params().to_vec());
                        }
                    }
                    Received::Corrupt => {
                        corrupt = true;
                        break;
                    }
                    Received::Nothing => {
                        self.wire.note_unanswered(&question);
                        break;
                    }
                }
            }
        }
        Err(self.unanswered(vec![self.id_of(index)], corrupt, doing))
    }

    /// The error for those who gave no sound answer.
    pub fn unanswered(&self, servos: Vec<ServoId>, corrupt: bool, doing: &'static str) -> BusError {
        let tries = self.tries;
        if corrupt {
            BusError::Corrupt {
                servos,
                doing,
                tries,
            }
        } else {
            BusError::Silent {
                servos,
                doing,
                tries,
            }
        }
    }

    /// Reads a register.
    pub fn read(&mut self, index: usize, register: Register) -> Result<u64, BusError> {
        Ok(register.value(&self.read_bytes(index, register)?))
    }

    /// Reads the bytes of a register, or of several in a row.
    pub fn read_bytes(&mut self, index: usize, register: Register) -> Result<Vec<u8>, BusError> {
        let mut params = Vec::with_capacity(4);
        self.wire
            .protocol()
            .put_number(&mut params, register.address);
        self.wire.protocol().put_number(&mut params, register.size);
        let size = usize::from(register.size);
        self.transfer(index, instruction::READ, &params, size, register.name)
    }

    /// Writes a register; the servo confirms.
    pub fn write(&mut self, index: usize, register: Register, value: u64) -> Result<(), BusError> {
        let mut params = Vec::with_capacity(6);
        self.wire
            .protocol()
            .put_number(&mut params, register.address);
        params.extend(&value.to_le_bytes()[..usize::from(register.size)]);
        self.transfer(index, instruction::WRITE, &params, 0, register.name)?;
        Ok(())
    }

    /// Writes a register of a servo that does not answer writes.
    pub fn write_unheard(
        &mut self,
        index: usize,
        register: Register,
        value: u64,
    ) -> Result<(), BusError> {
        match self.once(|link| link.write(index, register, value)) {
            Err(BusError::Silent { .. }) => Ok(()),
            written => written,
        }
    }

    /// Asks one servo whether it is there; what it answers.
    pub fn ping(&mut self, index: usize) -> Result<Vec<u8>, BusError> {
        let reply = self.wire.protocol().ping_params();
        self.transfer(index, instruction::PING, &[], reply, "ping")
    }

    /// Writes a register and reads it back.
    pub fn set(&mut self, index: usize, register: Register, value: u64) -> Result<(), BusError> {
        self.write(index, register, value)?;
        let actual = self.read(index, register)?;
        if actual != value {
            return Err(BusError::ReadBack {
                servo: self.id_of(index),
                register: register.name,
                wanted: value as i64,
                actual: actual as i64,
            });
        }
        Ok(())
    }

    /// Writes a register only if it holds another value; says so in the notes.
    pub fn settle(
        &mut self,
        index: usize,
        register: Register,
        value: u64,
        notes: &mut Vec<String>,
    ) -> Result<(), BusError> {
        let old = self.read(index, register)?;
        if old != value {
            self.set(index, register, value)?;
            let servo = self.id_of(index);
            notes.push(format!(
                "{servo}: {} changed from {old} to {value}",
                register.name
            ));
        }
        Ok(())
    }

    /// Checks that a register holds a value.
    pub fn expect(&mut self, index: usize, register: Register, value: u64) -> Result<(), BusError> {
        let actual = self.read(index, register)?;
        if actual == value {
            return Ok(());
        }
        Err(BusError::ReadBack {
            servo: self.id_of(index),
            register: register.name,
            wanted: value as i64,
            actual: actual as i64,
        })
    }

    /// Sends one value of `register` to every servo that is not left out, in one
    /// packet; no reply.
    pub fn sync_write(
        &mut self,
        register: Register,
        value: impl Fn(usize, &Servo) -> i32,
    ) -> Result<(), BusError> {
        self.hold_sync_write(register, value);
        self.wire.send_held(register.name)
    }

    /// The same, sent together with the next instruction.
    pub fn hold_sync_write(&mut self, register: Register, value: impl Fn(usize, &Servo) -> i32) {
        self.params.clear();
        let protocol = self.wire.protocol();
        protocol.put_number(&mut self.params, register.address);
        protocol.put_number(&mut self.params, register.size);
        for (index, servo) in self.servos.iter().enumerate() {
            if self.aside[index] {
                continue;
            }
            self.params.push(servo.id);
            let bytes = value(index, servo).to_le_bytes();
            self.params.extend(&bytes[..usize::from(register.size)]);
        }
        self.wire
            .hold(BROADCAST, instruction::SYNC_WRITE, &self.params);
    }

    /// Pings everyone and returns the answers; silent servos are all named at once.
    pub fn ping_all(&mut self) -> Result<Vec<Vec<u8>>, BusError> {
        let mut silent = Vec::new();
        let mut answers = Vec::with_capacity(self.servos.len());
        for index in 0..self.servos.len() {
            match self.ping(index) {
                Ok(answer) => answers.push(answer),
                Err(BusError::Silent { servos, .. }) => silent.extend(servos),
                Err(error) => return Err(error),
            }
        }
        if silent.is_empty() {
            Ok(answers)
        } else {
            Err(self.unanswered(silent, false, "ping"))
        }
    }

    /// One missing servo silences those behind it: ask each by itself, once,
    /// who it is. Where nobody answers at all, the first few speak for all.
    pub fn name_the_silent(&mut self, corrupt: bool) -> BusError {
        const ENOUGH: usize = 3;
        let missing: Vec<usize> = (0..self.servos.len())
            .filter(|&index| !self.answered[index])
            .collect();
        let mut silent = Vec::new();
        let mut heard = missing.len() < self.servos.len();
        for &index in &missing {
            if !heard && silent.len() == ENOUGH {
                silent = missing.clone();
                break;
            }
            match self.once(|link| link.ping(index)) {
                Err(BusError::Silent { .. }) => silent.push(index),
                Ok(_) | Err(BusError::Refused { .. } | BusError::Corrupt { .. }) => heard = true,
                Err(error) => return error,
            }
        }
        let corrupt = corrupt && silent.is_empty();
        let named = if silent.is_empty() { missing } else { silent };
        self.unanswered(self.ids_of(&named), corrupt, "present state")
    }

    /// Does something without retries.
    pub fn once<T>(&mut self, exchange: impl FnOnce(&mut Self) -> T) -> T {
        let tries = std::mem::replace(&mut self.tries, 1);
        let result = exchange(self);
        self.tries = tries;
        result
    }

    /// Torque off to everyone, those left out too, and the servos of which that
    /// is not certain.
    pub fn torque_off(&mut self, torque: Register) -> Result<(), BusError> {
        self.aside.fill(false);
        // Broadcast first: it needs no reply and reaches everyone at once.
        let mut reason = String::new();
        for _ in 0..self.tries {
            if let Err(error) = self.sync_write(torque, |_, _| 0) {
                reason = error.to_string();
            }
        }
        let mut doubtful = Vec::new();
        for index in 0..self.servos.len() {
            // After the first silent servo the others get one try each.
            let confirmed = if doubtful.is_empty() {
                self.set(index, torque, 0)
            } else {
                self.once(|link| link.set(index, torque, 0))
            };
            if let Err(error) = confirmed {
                reason = error.to_string();
                doubtful.push(index);
            }
        }
        if doubtful.is_empty() {
            return Ok(());
        }
        Err(BusError::TorqueUnverified {
            servos: self.ids_of(&doubtful),
            reason,
        })
    }

    /// A new read of everyone begins: who is left out need not answer.
    pub fn begin_read(&mut self) {
        self.answered.copy_from_slice(&self.aside);
    }

    /// Address, size and the ids of those who have not answered, ready in the
    /// parameters; how many they are.
    pub fn read_request(&mut self, register: Register) -> usize {
        self.params.clear();
        let protocol = self.wire.protocol();
        protocol.put_number(&mut self.params, register.address);
        protocol.put_number(&mut self.params, register.size);
        let before = self.params.len();
        for (index, servo) in self.servos.iter().enumerate() {
            if !self.answered[index] {
                self.params.push(servo.id);
            }
        }
        self.params.len() - before
    }

    /// Length, id and address of those who have not answered, as a Bulk Read of
    /// Protocol 1 has them, ready in the parameters; how many they are.
    pub fn bulk_request(&mut self, register: Register) -> usize {
        self.params.clear();
        self.params.push(0);
        for (servo, answered) in self.servos.iter().zip(&self.answered) {
            if !answered {
                let [size, address] = [register.size as u8, register.address as u8];
                self.params.extend([size, servo.id, address]);
            }
        }
        self.params.len() / 3
    }

    /// Sends the parameters that a request prepared.
    pub fn send_request(
        &mut self,
        instruction: u8,
        longest: usize,
        doing: &'static str,
    ) -> Result<(), BusError> {
        self.wire
            .send(BROADCAST, instruction, &self.params, longest, doing)
    }

    /// One plain Sync Read of those who have not answered yet, into `data`
    /// (register size a servo). The first servo that raised its alert bit.
    pub fn plain_read(
        &mut self,
        register: Register,
        data: &mut [u8],
    ) -> Result<Option<usize>, BusError> {
        let count = self.read_request(register);
        self.collect(instruction::SYNC_READ, count, register, data)
    }

    /// Sends a prepared request to `count` servos and takes their status
    /// packets into `data`. The first servo that raised its alert bit.
    pub fn collect(
        &mut self,
        instruction: u8,
        count: usize,
        register: Register,
        data: &mut [u8],
    ) -> Result<Option<usize>, BusError> {
        let size = usize::from(register.size);
        let protocol = self.wire.protocol();
        let longest = protocol.status_length() + size + size / 3;
        self.send_request(instruction, longest, register.name)?;
        let bytes = count * (protocol.status_bytes() + size);
        let deadline = self.deadline(bytes, count);
        let mut alert = None;
        let mut open = count;
        let mut damaged = 0;
        while open > damaged {
            match self.wire.receive(deadline, register.name)? {
                Received::Packet => {}
                // Whoever was damaged does not speak again: do not wait for it.
                Received::Corrupt => {
                    damaged += 1;
                    continue;
                }
                Received::Nothing => break,
            }
            let packet = self.wire.packet();
            let index = self.servos.iter().position(|servo| servo.id == packet.id);
            let Some(index) = index.filter(|&index| !self.answered[index]) else {
                continue;
            };
            if packet.error() != 0 {
                return Err(BusError::Refused {
                    servo: self.id_of(index),
                    doing: register.name,
                    refusal: Refusal(packet.error()),
                });
            }
            if packet.params().len() == size {
                data[index * size..][..size].copy_from_slice(packet.params());
                self.answered[index] = true;
                alert = alert.or(packet.alert().then_some(index));
                open -= 1;
            }
        }
        Ok(alert)
    }

    /// Whether every servo has answered.
    pub fn complete(&self) -> bool {
        self.answered.iter().all(|answered| *answered)
    }

    /// The goal that keeps a joint where it stands.
    pub fn holding_goal(&self, index: usize, ticks: i32) -> Result<i32, BusError> {
        let servo = &self.servos[index];
        let hold_rad = servo.holding_rad(servo.position_rad(ticks))?;
        Ok(servo.goal_ticks(hold_rad))
    }
}
