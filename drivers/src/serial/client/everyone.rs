//! Instructions to every servo at once: one packet out, a status packet from each.

use dynamixel2::instructions::instruction_id as instruction;
use dynamixel2::instructions::packet_id::BROADCAST;

use crate::error::{BusError, BusResult, Refusal};
use crate::serial::client::ServoClient;
use crate::serial::register::Register;
use crate::serial::wire::port::Received;
use crate::servo::Servo;

impl ServoClient {
    /// Sends a value of `register` to every servo that is not left out and gets one; no reply.
    pub(crate) fn sync_write(
        &mut self,
        register: Register,
        value: impl Fn(usize, &Servo) -> Option<i32>,
    ) -> BusResult<()> {
        self.hold_sync_write(register, 1, value);
        self.port.send_held(register.name)
    }

    /// The same in one packet that is said so many times, and kept for what is sent next.
    pub(crate) fn hold_sync_write(
        &mut self,
        register: Register,
        copies: usize,
        value: impl Fn(usize, &Servo) -> Option<i32>,
    ) {
        self.params.clear();
        self.port.framing().put_place(&mut self.params, register);
        let nobody = self.params.len();
        for (index, servo) in self.servos.iter().enumerate() {
            let Some(value) = value(index, servo).filter(|_| !self.aside[index]) else { continue };
            self.params.push(servo.id);
            self.params.extend(&value.to_le_bytes()[..usize::from(register.size)]);
        }
        if self.params.len() > nobody {
            for _ in 0..copies {
                self.port.hold(BROADCAST, instruction::SYNC_WRITE, &self.params);
            }
        }
    }

    /// Torque off to everyone, those left out too, and the servos of which that is not certain.
    pub(crate) fn torque_off(&mut self, torque: Register) -> BusResult<()> {
        self.aside.fill(false);
        // Broadcast first: it needs no reply and reaches everyone at once.
        let mut reason = String::new();
        for _ in 0..self.tries {
            if let Err(error) = self.sync_write(torque, |_, _| Some(0)) {
                reason = error.to_string();
            }
        }
        let mut doubtful = Vec::new();
        for index in 0..self.servos.len() {
            // After the first silent servo the others get one try each.
            let confirmed = if doubtful.is_empty() {
                self.set(index, torque, 0)
            } else {
                self.once(|client| client.set(index, torque, 0))
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
            servos: doubtful.iter().map(|&index| self.id_of(index)).collect(),
            reason,
        })
    }

    pub(crate) fn begin_read(&mut self) {
        self.answered.copy_from_slice(&self.aside);
        self.asked_last = None;
    }

    /// Those who have not answered, in the order in which they are asked.
    fn unanswered_in_order(&self) -> impl Iterator<Item = usize> {
        let asked = |index: &usize| !self.answered[*index];
        let last = self.asked_last.filter(asked);
        let first = (0..self.servos.len()).filter(asked).filter(move |index| Some(*index) != last);
        first.chain(last)
    }

    /// Address, size and the ids of those who have not answered, ready in the
    /// parameters; how many they are.
    pub(crate) fn read_request(&mut self, register: Register) -> usize {
        self.params.clear();
        self.port.framing().put_place(&mut self.params, register);
        let before = self.params.len();
        let mut params = std::mem::take(&mut self.params);
        params.extend(self.unanswered_in_order().map(|index| self.servos[index].id));
        self.params = params;
        self.params.len() - before
    }

    /// Length, id and address of those who have not answered, as a Bulk Read of
    /// Protocol 1 has them, ready in the parameters; how many they are.
    pub(crate) fn bulk_request(&mut self, register: Register) -> usize {
        self.params.clear();
        self.params.push(0);
        let [size, address] = [register.size as u8, register.address as u8];
        let mut params = std::mem::take(&mut self.params);
        for index in self.unanswered_in_order() {
            params.extend([size, self.servos[index].id, address]);
        }
        self.params = params;
        self.params.len() / 3
    }

    pub(crate) fn send_request(
        &mut self,
        instruction: u8,
        longest: usize,
        doing: &'static str,
    ) -> BusResult<()> {
        self.port.send(BROADCAST, instruction, &self.params, longest, doing)
    }

    /// One plain Sync Read of those who have not answered yet, into `data`
    /// (register size a servo). The first servo that raised its alert bit.
    pub fn sync_read(&mut self, register: Register, data: &mut [u8]) -> BusResult<Option<usize>> {
        let count = self.read_request(register);
        self.collect(instruction::SYNC_READ, count, register, data)
    }

    /// Sends a prepared request to `count` servos and takes their status
    /// packets into `data`. The first servo that raised its alert bit.
    pub(crate) fn collect(
        &mut self,
        instruction: u8,
        count: usize,
        register: Register,
        data: &mut [u8],
    ) -> BusResult<Option<usize>> {
        let size = usize::from(register.size);
        let framing = self.port.framing();
        let longest = framing.status_length() + size + size / 3;
        self.send_request(instruction, longest, register.name)?;
        let bytes = count * (framing.status_bytes() + size);
        let deadline = self.deadline(bytes, count);
        let mut alert = None;
        let mut open = count;
        // They answer in the order in which they were asked: nobody speaks after the last.
        let last = self.unanswered_in_order().last();
        let mut damaged = 0;
        while open > damaged {
            match self.port.receive(deadline, register.name)? {
                Received::Packet => {}
                // Whoever was damaged does not speak again: do not wait for it.
                Received::Corrupt => {
                    damaged += 1;
                    continue;
                }
                Received::Nothing => {
                    self.learn_loss();
                    break;
                }
            }
            let packet = self.port.packet();
            let index = self.servos.iter().position(|servo| servo.id == packet.id);
            let Some(index) = index.filter(|&index| !self.answered[index]) else {
                continue;
            };
            if packet.error() == Refusal::CRC.0 {
                // It heard something damaged, and does not know to whom that was said.
                self.errors.damaged(index);
                continue;
            }
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
                if Some(index) == last {
                    break;
                }
            }
        }
        if open == 0 {
            self.learn(bytes);
        }
        self.blame_the_unanswered();
        Ok(alert)
    }

    /// Counts an answer that did not come, for each servo that somebody behind it outlived
    /// and for the first of those after whom nobody spoke: it broke the chain.
    fn blame_the_unanswered(&self) {
        let last_heard = (0..self.servos.len()).rev().find(|&i| self.answered[i] && !self.aside[i]);
        let end = last_heard.map_or(0, |index| index + 1);
        let silent = (0..end).filter(|&index| !self.answered[index]);
        let broke = (end..self.servos.len()).find(|&index| !self.answered[index]);
        silent.chain(broke).for_each(|index| self.errors.timed_out(index));
    }

    /// A register of everyone who is not left out, by place: one Sync Read, tried again for
    /// those who did not answer.
    pub(crate) fn read_everyone(&mut self, register: Register) -> BusResult<Vec<(usize, u64)>> {
        let size = usize::from(register.size);
        let mut data = vec![0; size * self.servos.len()];
        let damaged = self.port.stats.crc_errors;
        self.begin_read();
        for _ in 0..self.tries {
            self.sync_read(register, &mut data)?;
            if self.complete() {
                let asked = (0..self.servos.len()).filter(|&index| !self.aside[index]);
                let bytes = |index: usize| &data[index * size..][..size];
                return Ok(asked.map(|index| (index, register.value(bytes(index)))).collect());
            }
        }
        let corrupt = self.port.stats.crc_errors > damaged;
        Err(self.name_the_silent(corrupt))
    }

    /// Counts that those who have not answered are asked again.
    pub(crate) fn ask_again(&mut self) {
        self.port.stats.retries += 1;
        // Whoever broke the chain of answers: it may not be there.
        let broke = self.unanswered_in_order().next();
        self.asked_last = broke;
        let silent = (0..self.servos.len()).filter(|&index| !self.answered[index]);
        // All of them: the bus was damaged, nobody in particular.
        if silent.clone().count() < self.servos.len() {
            silent.for_each(|index| self.errors.asked_again(index));
        }
    }

    /// Whether anyone has answered since [`ServoClient::begin_read`].
    pub(crate) fn anyone_answered(&self) -> bool {
        self.answered.iter().zip(&self.aside).any(|(answered, aside)| *answered && !aside)
    }

    pub(crate) fn count_unheard(&mut self) {
        let nobody = !self.complete() && !self.anyone_answered();
        self.unheard_questions = if nobody { self.unheard_questions + 1 } else { 0 };
    }

    pub(crate) fn complete(&self) -> bool {
        self.answered.iter().all(|answered| *answered)
    }

    /// Reads those who have not answered yet one by one, each once, into `data`
    /// (register size a servo). The first servo that raised its alert bit.
    pub fn read_each(&mut self, register: Register, data: &mut [u8]) -> BusResult<Option<usize>> {
        let size = usize::from(register.size);
        let mut alert = None;
        for index in 0..self.servos.len() {
            if self.answered[index] {
                continue;
            }
            match self.once(|client| client.read_bytes(index, register)) {
                Ok(bytes) => {
                    data[index * size..][..size].copy_from_slice(&bytes);
                    self.answered[index] = true;
                    alert = alert.or(self.alert.then_some(index));
                }
                Err(BusError::Silent { .. } | BusError::Corrupt { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(alert)
    }
}
