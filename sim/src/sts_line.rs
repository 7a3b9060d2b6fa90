//! The far end of a Feetech bus: Protocol 1 framing and STS instructions.
//!
//! `FF FF ID LEN INST params CHK`; answers carry the servo's condition in place
//! of INST. A Sync Read is answered one by one, as in [`crate::XLine`].

use crate::fault::ServoFault;
use crate::judge::Judge;
use crate::line::{Burst, Line, collided};
use crate::packet::BROADCAST;
use crate::servo::SimServoState;
use crate::sts::StsServo;

mod code {
    pub const PING: u8 = 1;
    pub const READ: u8 = 2;
    pub const WRITE: u8 = 3;
    pub const REG_WRITE: u8 = 4;
    pub const ACTION: u8 = 5;
    pub const REBOOT: u8 = 8;
    pub const SYNC_READ: u8 = 0x82;
    pub const SYNC_WRITE: u8 = 0x83;
}

/// STS servos on one line.
#[derive(Debug)]
pub struct StsLine {
    buffer: Vec<u8>,
    /// A complete frame: id, instruction, parameters.
    frame: Option<(u8, u8, Vec<u8>)>,
    servos: Vec<StsServo>,
    packets_in: u64,
    bad_packets: u64,
}

impl StsLine {
    /// A line with these servos.
    pub fn new(servos: Vec<StsServo>) -> Self {
        Self {
            buffer: Vec::new(),
            frame: None,
            servos,
            packets_in: 0,
            bad_packets: 0,
        }
    }

    fn find_all(&self, id: u8) -> Vec<usize> {
        (0..self.servos.len())
            .filter(|&index| self.servos[index].listens() && self.servos[index].id() == id)
            .collect()
    }

    fn reply(&self, index: usize, params: &[u8]) -> Burst {
        let servo = &self.servos[index];
        Burst {
            servo: index,
            delay_s: servo.return_delay_s(),
            bytes: answer(servo.id(), servo.status(), params),
        }
    }

    fn single(&mut self, index: usize, instruction: u8, params: &[u8]) -> Option<Burst> {
        let servo = &mut self.servos[index];
        match (instruction, params) {
            (code::PING, _) => return Some(self.reply(index, &[])),
            (code::READ, &[address, size]) => {
                let data = servo.read(address, size);
                return Some(self.reply(index, &data));
            }
            (code::WRITE, [address, data @ ..]) => servo.write(*address, data),
            (code::REG_WRITE, [address, data @ ..]) => servo.register(*address, data),
            (code::ACTION, _) => servo.act(),
            (code::REBOOT, _) => {
                let reply = self.reply(index, &[]);
                self.servos[index].reboot();
                return Some(reply);
            }
            _ => return None,
        }
        let answers = self.servos[index].answers_writes();
        answers.then(|| self.reply(index, &[]))
    }

    fn sync_read(&mut self, params: &[u8]) -> Vec<Burst> {
        let mut bursts = Vec::new();
        let &[address, size, ref ids @ ..] = params else {
            return bursts;
        };
        for &id in ids {
            let mut answers = Vec::with_capacity(1);
            for index in self.find_all(id) {
                let data = self.servos[index].read(address, size);
                answers.push(self.reply(index, &data));
            }
            if answers.is_empty() {
                break;
            }
            bursts.extend(collided(answers));
        }
        bursts
    }

    fn sync_write(&mut self, params: &[u8]) {
        let &[address, size, ref items @ ..] = params else {
            return;
        };
        for item in items.chunks_exact(1 + usize::from(size)) {
            for index in self.find_all(item[0]) {
                self.servos[index].write(address, &item[1..]);
            }
        }
    }
}

/// A status packet.
fn answer(id: u8, status: u8, params: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0xFF, 0xFF, id, params.len() as u8 + 2, status];
    bytes.extend(params);
    bytes.push(complement(&bytes[2..]));
    bytes
}

fn complement(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte))
}

impl Line for StsLine {
    fn push(&mut self, byte: u8) -> bool {
        self.buffer.push(byte);
        while self.buffer.iter().take(2).any(|byte| *byte != 0xFF)
            || self.buffer.starts_with(&[0xFF, 0xFF, 0xFF])
        {
            self.buffer.remove(0);
        }
        let Some(&length) = self.buffer.get(3) else {
            return false;
        };
        if length < 2 {
            self.buffer.clear();
            return false;
        }
        if self.buffer.len() < 4 + usize::from(length) {
            return false;
        }
        let frame = std::mem::take(&mut self.buffer);
        let end = frame.len() - 1;
        if complement(&frame[2..end]) != frame[end] {
            self.bad_packets += 1;
            return false;
        }
        self.frame = Some((frame[2], frame[4], frame[5..end].to_vec()));
        true
    }

    fn execute(&mut self) -> Vec<Burst> {
        let Some((id, instruction, params)) = self.frame.take() else {
            return Vec::new();
        };
        self.packets_in += 1;
        match instruction {
            code::SYNC_READ => self.sync_read(&params),
            code::SYNC_WRITE => {
                self.sync_write(&params);
                Vec::new()
            }
            _ if id == BROADCAST => {
                for index in 0..self.servos.len() {
                    if self.servos[index].listens() {
                        self.single(index, instruction, &params);
                    }
                }
                Vec::new()
            }
            _ => {
                let addressed = self.find_all(id).into_iter();
                let answers = addressed.filter_map(|i| self.single(i, instruction, &params));
                collided(answers.collect())
            }
        }
    }

    fn step(&mut self, time_s: f64, dt_s: f64, period_ends: bool) {
        for servo in &mut self.servos {
            servo.step(time_s, dt_s);
            if period_ends {
                servo.end_period();
            }
        }
    }

    fn judges(&self) -> Vec<&Judge> {
        self.servos.iter().map(StsServo::judge).collect()
    }

    fn state(&self, index: usize) -> Option<SimServoState> {
        self.servos.get(index).map(StsServo::state)
    }

    fn suffer(&mut self, index: usize, fault: ServoFault) -> bool {
        let servo = self.servos.get_mut(index);
        servo.map(|servo| servo.suffer(fault)).is_some()
    }

    fn packets(&self) -> (u64, u64) {
        (self.packets_in, self.bad_packets)
    }
}
