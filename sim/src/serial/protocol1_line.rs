//! The far end of a Protocol 1 bus: Feetech STS, AX and MX(1.0).
//!
//! `FF FF ID LEN INST params CHK`; answers carry the servo's condition and the
//! instruction's errors in place of INST. A Sync Read (STS) or a Bulk Read (MX)
//! is answered one by one, as in [`crate::Protocol2Line`].

use servodance_drivers::serial::{ByteMemory, instruction as code};

use crate::bus::line::{Burst, Line};
use crate::fault::ServoFault;
use crate::judge::Judge;
use crate::serial::protocol2_packet::BROADCAST;
use crate::serial::roster::{LineServo, Roster, collided};
use crate::servo::body::SimServoState;
use crate::servo::byte_servo::ByteServo;

#[derive(Debug)]
enum Frame {
    Sound {
        id: u8,
        instruction: u8,
        params: Vec<u8>,
    },
    Damaged(u8),
}

/// Servos of byte memory on one line.
#[derive(Debug)]
pub struct Protocol1Line {
    buffer: Vec<u8>,
    frame: Option<Frame>,
    roster: Roster<ByteServo>,
}

/// Errors of an instruction, by the bits of the answer.
const CHECKSUM_ERROR: u8 = 1 << 4;
const INSTRUCTION_ERROR: u8 = 1 << 6;

impl Protocol1Line {
    /// A line of this rate with these servos on a supply of this resistance.
    pub fn new(servos: Vec<ByteServo>, baud: u32, supply_ohm: f64) -> Self {
        Self {
            buffer: Vec::new(),
            frame: None,
            roster: Roster::new(servos, supply_ohm, baud),
        }
    }

    fn reply(&self, index: usize, error: u8, params: &[u8]) -> Burst {
        let servo = &self.roster.servos[index];
        Burst {
            servo: index,
            delay_s: servo.return_delay_s(),
            bytes: answer(servo.id(), servo.status() | error, params),
        }
    }

    fn single(&mut self, index: usize, instruction: u8, params: &[u8]) -> Option<Burst> {
        let servo = &mut self.roster.servos[index];
        let mut error = 0;
        match (instruction, params) {
            (code::PING, _) => return Some(self.reply(index, 0, &[])),
            (code::READ, &[address, size]) => {
                let data = servo.read(address, size);
                return servo.answers_reads().then(|| self.reply(index, 0, &data));
            }
            (code::WRITE, [address, data @ ..]) => error = servo.write(*address, data),
            (code::REG_WRITE, [address, data @ ..]) => servo.register(*address, data),
            (code::ACTION, _) => servo.act(),
            (code::REBOOT, _) if servo.memory().reboots => {
                let reply = self.reply(index, 0, &[]);
                self.roster.servos[index].reboot();
                return Some(reply);
            }
            (code::FACTORY_RESET, _) if !servo.memory().reboots => {
                let reply = self.reply(index, 0, &[]);
                self.roster.servos[index].factory_reset();
                return Some(reply);
            }
            // Feetech's servos say nothing to what they do not know.
            _ if servo.memory().sync_read => return None,
            _ => error = INSTRUCTION_ERROR,
        }
        let answers = self.roster.servos[index].answers_writes();
        answers.then(|| self.reply(index, error, &[]))
    }

    /// Answers one after the other, up to the first servo that is missing or
    /// does not know the instruction.
    fn chain(&mut self, parts: &[(u8, u8, u8)], knows: impl Fn(&ByteMemory) -> bool) -> Vec<Burst> {
        let mut bursts = Vec::new();
        for &(id, address, size) in parts {
            let mut answers = Vec::with_capacity(1);
            for index in self.roster.find_all(id) {
                if knows(self.roster.servos[index].memory()) {
                    let data = self.roster.servos[index].read(address, size);
                    answers.push(self.reply(index, 0, &data));
                }
            }
            if answers.is_empty() {
                break;
            }
            bursts.extend(collided(answers));
        }
        bursts
    }

    fn sync_read(&mut self, params: &[u8]) -> Vec<Burst> {
        let &[address, size, ref ids @ ..] = params else {
            return Vec::new();
        };
        let parts: Vec<_> = ids.iter().map(|&id| (id, address, size)).collect();
        self.chain(&parts, |memory| memory.sync_read)
    }

    fn bulk_read(&mut self, params: &[u8]) -> Vec<Burst> {
        let parts = params.get(1..).unwrap_or_default().chunks_exact(3);
        let parts: Vec<_> = parts.map(|part| (part[1], part[2], part[0])).collect();
        self.chain(&parts, |memory| memory.bulk_read)
    }

    fn sync_write(&mut self, params: &[u8]) {
        let &[address, size, ref items @ ..] = params else {
            return;
        };
        for item in items.chunks_exact(1 + usize::from(size)) {
            for index in self.roster.find_all(item[0]) {
                // Refused writes of a broadcast are not answered.
                self.roster.servos[index].write(address, &item[1..]);
            }
        }
    }
}

fn answer(id: u8, status: u8, params: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0xFF, 0xFF, id, params.len() as u8 + 2, status];
    bytes.extend(params);
    bytes.push(complement(&bytes[2..]));
    bytes
}

fn complement(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte))
}

impl Line for Protocol1Line {
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
            self.frame = Some(Frame::Damaged(frame[2]));
        } else {
            self.frame = Some(Frame::Sound {
                id: frame[2],
                instruction: frame[4],
                params: frame[5..end].to_vec(),
            });
        }
        true
    }

    fn execute(&mut self) -> Vec<Burst> {
        let (id, instruction, params) = match self.frame.take() {
            None => return Vec::new(),
            Some(Frame::Damaged(id)) => {
                self.roster.bad_packets += 1;
                let heard = self.roster.find_all(id);
                // Feetech's servos say nothing to a damaged instruction.
                let index = heard.first().copied();
                let index = index.filter(|&i| !self.roster.servos[i].memory().sync_read);
                return index.map_or_else(Vec::new, |i| vec![self.reply(i, CHECKSUM_ERROR, &[])]);
            }
            Some(Frame::Sound {
                id,
                instruction,
                params,
            }) => (id, instruction, params),
        };
        self.roster.packets_in += 1;
        match instruction {
            code::SYNC_READ => self.sync_read(&params),
            code::BULK_READ => self.bulk_read(&params),
            code::SYNC_WRITE => {
                self.sync_write(&params);
                Vec::new()
            }
            _ if id == BROADCAST => {
                for index in self.roster.listeners() {
                    self.single(index, instruction, &params);
                }
                Vec::new()
            }
            _ => {
                let addressed = self.roster.find_all(id).into_iter();
                let answers = addressed.filter_map(|i| self.single(i, instruction, &params));
                collided(answers.collect())
            }
        }
    }

    fn set_host_baud(&mut self, baud: u32) {
        self.roster.set_host_baud(baud);
    }

    fn step(&mut self, time_s: f64, dt_s: f64, period_ends: bool) {
        self.roster.step(time_s, dt_s, period_ends);
    }

    fn judges(&self) -> Vec<&Judge> {
        self.roster.judges()
    }

    fn state(&self, index: usize) -> Option<SimServoState> {
        self.roster.state(index)
    }

    fn suffer(&mut self, index: usize, fault: ServoFault) -> bool {
        self.roster.suffer(index, fault)
    }

    fn packets(&self) -> (u64, u64) {
        (self.roster.packets_in, self.roster.bad_packets)
    }
}
