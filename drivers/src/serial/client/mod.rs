//! Requests to the servos of one serial bus and their replies, in either framing.
//!
//! Instructions, retries, read-back, and the names of the servos to blame. Every
//! exchange is bounded: wire time, return delay and the reply timeout, times
//! the tries (`timeout.rs`). Nothing here knows what the registers mean.

mod everyone;

use dynamixel2::instructions::instruction_id as instruction;

use crate::bus::Notes;
use crate::bus::config::BusConfig;
use crate::bus::error_counters::ErrorCounters;
use crate::error::{BusError, BusResult, Refusal, ServoId};
use crate::serial::deviation::{Deviation, Remedy};
use crate::serial::family::ServoFamily;
use crate::serial::patience::Patience;
use crate::serial::register::Register;
use crate::serial::wire::port::{PacketPort, Received};
use crate::serial::wire::stale_replies::ServoRequest;
use crate::servo::Servo;

/// One serial bus and the servos on it.
pub struct ServoClient {
    pub(crate) port: PacketPort,
    pub(crate) servos: Vec<Servo>,
    pub(crate) config: BusConfig,
    /// How often an exchange is tried; less while it is known that servos are silent.
    pub(super) tries: u32,
    params: Vec<u8>,
    pub(crate) answered: Vec<bool>,
    pub(crate) aside: Vec<bool>,
    /// So many questions to everyone in a row were not heard, or nothing of their answers.
    pub(super) unheard_questions: u32,
    /// Asked after the others: a servo that stays silent silences those behind it.
    pub(super) asked_last: Option<usize>,
    /// Whether the last answer to [`ServoClient::transfer`] had its alert bit set.
    alert: bool,
    /// The error byte of that answer, as it came.
    pub(crate) flags: u8,
    pub(crate) firmware: Vec<u8>,
    /// Everyone answers the Fast Sync Read of Protocol 2.0.
    pub(crate) fast_read: bool,
    /// After a loss so many reads are plain ones.
    pub(crate) plain_after_loss: u32,
    /// For so many reads more a plain Sync Read is better: it loses one servo, not all.
    pub(crate) plain_reads: u32,
    /// Whether what is asked belongs to a cycle, whose answers have a patience of their own.
    pub(crate) waits_for_cycle: bool,
    /// Whether there is time in the period to ask those again who stay silent.
    pub(crate) asks_again_soon: bool,
    pub(crate) patience: Patience,
    pub(crate) errors: ErrorCounters,
}

impl ServoClient {
    /// Opens the port; `config` is checked. Nothing is sent.
    pub(crate) fn open(
        port: &str,
        config: BusConfig,
        servos: Vec<Servo>,
        family: &dyn ServoFamily,
    ) -> BusResult<Self> {
        let (framing, clock) = (family.framing(), config.reply_clock.clone());
        let mut port = PacketPort::open(port, config.baud, framing, clock)?;
        port.read_flags_as(family.error_flags());
        Ok(Self {
            port,
            answered: vec![false; servos.len()],
            aside: vec![false; servos.len()],
            unheard_questions: 0,
            asked_last: None,
            alert: false,
            flags: 0,
            firmware: vec![0; servos.len()],
            fast_read: false,
            plain_after_loss: 0,
            plain_reads: 0,
            waits_for_cycle: false,
            asks_again_soon: false,
            patience: Patience::default(),
            errors: ErrorCounters::new(servos.len()),
            params: Vec::with_capacity(8 + 5 * servos.len()),
            servos,
            tries: config.retries + 1,
            config,
        })
    }

    /// The servos, in the order of targets and states.
    pub fn servos(&self) -> &[Servo] {
        &self.servos
    }

    /// The joint and id of the servo at `index`.
    pub(crate) fn id_of(&self, index: usize) -> ServoId {
        ServoId::of(&self.servos[index])
    }

    /// One instruction to one servo; the `reply` parameters of its status packet.
    pub fn transfer(
        &mut self,
        index: usize,
        instruction: u8,
        params: &[u8],
        reply: usize,
        doing: &'static str,
    ) -> BusResult<Vec<u8>> {
        let id = self.servos[index].id;
        let request = ServoRequest { id, instruction, params, reply };
        let bytes = self.port.framing().status_bytes() + reply;
        let mut corrupt = false;
        for attempt in 0..self.tries {
            if attempt > 0 {
                self.port.stats.retries += 1;
                self.errors.asked_again(index);
            }
            self.port.ask(&request, self.wait(bytes, 1), doing)?;
            let deadline = self.deadline(bytes, 1);
            loop {
                match self.port.receive(deadline, doing)? {
                    Received::Packet => {
                        let packet = self.port.packet();
                        if packet.id != id {
                            continue;
                        }
                        // The servo heard a damaged instruction: say it again.
                        if packet.error() == Refusal::CRC.0 {
                            self.port.stats.crc_errors += 1;
                            self.errors.damaged(index);
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
                            (self.alert, self.flags) = (packet.alert(), packet.flags());
                            return Ok(packet.params().to_vec());
                        }
                    }
                    Received::Corrupt => {
                        self.errors.damaged(index);
                        corrupt = true;
                        break;
                    }
                    Received::Nothing => {
                        self.errors.timed_out(index);
                        self.port.note_unanswered(&request);
                        break;
                    }
                }
            }
        }
        Err(self.unanswered(vec![self.id_of(index)], corrupt, doing))
    }

    /// The error byte of the last answer, as it came: in Protocol 1 flags.
    pub fn flags(&self) -> u8 {
        self.flags
    }

    /// The unsigned value of a register.
    pub fn read(&mut self, index: usize, register: Register) -> BusResult<u64> {
        Ok(register.value(&self.read_bytes(index, register)?))
    }

    /// The bytes of a register, or of several in a row.
    pub fn read_bytes(&mut self, index: usize, register: Register) -> BusResult<Vec<u8>> {
        let params = self.port.framing().read_params(register);
        let size = usize::from(register.size);
        self.transfer(index, instruction::READ, &params, size, register.name)
    }

    /// Writes a register; the servo confirms.
    pub fn write(&mut self, index: usize, register: Register, value: u64) -> BusResult<()> {
        let params = self.port.framing().write_params(register, value);
        self.transfer(index, instruction::WRITE, &params, 0, register.name)?;
        Ok(())
    }

    /// Writes a register of a servo that may not answer writes.
    pub fn write_unheard(&mut self, index: usize, register: Register, value: u64) -> BusResult<()> {
        match self.once(|client| client.write(index, register, value)) {
            Err(BusError::Silent { .. }) => Ok(()),
            written => written,
        }
    }

    /// Asks one servo whether it is there: the parameters of its answer.
    pub fn ping(&mut self, index: usize) -> BusResult<Vec<u8>> {
        let reply = self.port.framing().ping_params();
        self.transfer(index, instruction::PING, &[], reply, "ping")
    }

    /// Writes a register and reads it back.
    pub fn set(&mut self, index: usize, register: Register, value: u64) -> BusResult<()> {
        self.write(index, register, value)?;
        self.expect(index, register, value)
    }

    /// Writes a register only if it holds another value; says so in the notes.
    pub fn settle(
        &mut self,
        index: usize,
        register: Register,
        value: u64,
        notes: &mut Notes,
    ) -> BusResult<()> {
        let old = self.read(index, register)?;
        if old != value {
            self.set(index, register, value)?;
            let servo = self.id_of(index);
            notes.push(format!("{servo}: {} changed from {old} to {value}", register.name));
        }
        Ok(())
    }

    /// Writes what deviates and may be written, with a note each; refuses what is dangerous.
    pub(crate) fn put_right(
        &mut self,
        index: usize,
        deviations: &[Deviation],
        notes: &mut Notes,
    ) -> BusResult<()> {
        let servo = self.id_of(index);
        for deviation in deviations {
            let register = deviation.register;
            match deviation.remedy {
                Remedy::Write(value) => {
                    self.set(index, register, value)?;
                    let Deviation { actual, why, .. } = deviation;
                    notes.push(format!(
                        "{servo}: {} changed from {actual} to {value} ({why})",
                        register.name
                    ));
                }
                Remedy::Tell => notes.push(format!("{servo}: {}", deviation.line())),
                Remedy::Refuse => {
                    return Err(BusError::Unfit {
                        servo,
                        what: register.name,
                        actual: deviation.actual.to_string(),
                        wanted: format!("{}: {}", deviation.wanted, deviation.why),
                    });
                }
            }
        }
        Ok(())
    }

    /// Checks that a register holds a value.
    pub fn expect(&mut self, index: usize, register: Register, value: u64) -> BusResult<()> {
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

    pub(crate) fn holding_goal(&self, index: usize, ticks: i32) -> BusResult<i32> {
        let servo = &self.servos[index];
        let hold_rad = servo.holding_rad(servo.position_rad(ticks))?;
        Ok(servo.goal_ticks(hold_rad))
    }
}
