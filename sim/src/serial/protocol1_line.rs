//! The far end of a Protocol 1 bus: Feetech STS, AX and MX(1.0).
//!
//! `FF FF ID LEN INST params CHK`; answers carry the servo's condition and the
//! instruction's errors in place of INST. A Sync Read (STS) or a Bulk Read (MX)
//! is answered one by one, as in [`crate::Protocol2Line`].

use servodance_drivers::serial::{ByteMemory, instruction as code};

use crate::bus::line::Burst;
use crate::serial::protocol2_packet::{BROADCAST, Instruction, Parsed};
use crate::serial::serial_line::{LineProtocol, LineServo, SerialLine, collided};
use crate::servo::byte_servo::ByteServo;

/// Servos of byte memory on one line.
pub type Protocol1Line = SerialLine<ByteServo>;

/// Errors of an instruction, by the bits of the answer.
const CHECKSUM_ERROR: u8 = 1 << 4;
const INSTRUCTION_ERROR: u8 = 1 << 6;

impl Protocol1Line {
    fn reply(&self, index: usize, error: u8, params: &[u8]) -> Burst {
        self.reply_from(self.servos[index].id(), index, error, params)
    }

    fn reply_from(&self, id: u8, index: usize, error: u8, params: &[u8]) -> Burst {
        let servo = &self.servos[index];
        Burst {
            servo: index,
            delay_s: servo.return_delay_s(),
            bytes: answer(id, servo.flags | error, params),
        }
    }

    fn single(&mut self, index: usize, instruction: u8, params: &[u8]) -> Option<Burst> {
        // A new id is in force from the next instruction on.
        let asked_as = self.servos[index].id();
        let servo = &mut self.servos[index];
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
            (code::REBOOT, _) if servo.layout.reboots => {
                let reply = self.reply(index, 0, &[]);
                self.servos[index].reboot();
                return Some(reply);
            }
            (code::FACTORY_RESET, _) if !servo.layout.reboots => {
                let reply = self.reply(index, 0, &[]);
                self.servos[index].factory_reset();
                return Some(reply);
            }
            // Feetech's servos say nothing to what they do not know.
            _ if servo.layout.sync_read => return None,
            _ => error = INSTRUCTION_ERROR,
        }
        let answers = self.servos[index].answers_writes();
        answers.then(|| self.reply_from(asked_as, index, error, &[]))
    }

    /// Feetech's servos answer a ping of everyone one after the other, by id; AX and MX do not.
    fn broadcast_ping(&self) -> Vec<Burst> {
        let mut heard = self.listeners();
        heard.retain(|&index| self.servos[index].layout.sync_read);
        heard.sort_by_key(|&index| self.servos[index].id());
        heard.into_iter().map(|index| self.reply(index, 0, &[])).collect()
    }

    /// Answers one after the other, up to the first servo that is missing or
    /// does not know the instruction.
    fn chain(&mut self, parts: &[(u8, u8, u8)], knows: impl Fn(&ByteMemory) -> bool) -> Vec<Burst> {
        let mut bursts = Vec::new();
        for &(id, address, size) in parts {
            let mut answers = Vec::with_capacity(1);
            for index in self.find_all(id) {
                if knows(self.servos[index].layout) {
                    let data = self.servos[index].read(address, size);
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

    fn sync_write(&mut self, params: &[u8]) -> Vec<Burst> {
        let &[address, size, ref items @ ..] = params else {
            return Vec::new();
        };
        for item in items.chunks_exact(1 + usize::from(size)) {
            for index in self.find_all(item[0]) {
                // Refused writes of a broadcast are not answered.
                self.servos[index].write(address, &item[1..]);
            }
        }
        Vec::new()
    }
}

impl LineProtocol for ByteServo {
    type Parser = Vec<u8>;

    fn goals(line: &Protocol1Line, packet: &Parsed) -> Vec<u8> {
        let Parsed::Instruction(Instruction { code: code::SYNC_WRITE, params, .. }) = packet else {
            return Vec::new();
        };
        let goal = |servo: &ByteServo| servo.layout.registers.goal.address as u8;
        match params.split_first_chunk() {
            Some((&[address, size], items)) if line.servos.first().map(goal) == Some(address) => {
                items.chunks_exact(1 + usize::from(size)).map(|item| item[0]).collect()
            }
            _ => Vec::new(),
        }
    }

    fn parse(buffer: &mut Vec<u8>, byte: u8) -> Option<Parsed> {
        buffer.push(byte);
        while buffer.iter().take(2).any(|byte| *byte != 0xFF)
            || buffer.starts_with(&[0xFF, 0xFF, 0xFF])
        {
            buffer.remove(0);
        }
        let length = usize::from(*buffer.get(3)?);
        if length < 2 {
            buffer.clear();
            return None;
        }
        if buffer.len() < 4 + length {
            return None;
        }
        let frame = std::mem::take(buffer);
        let end = frame.len() - 1;
        if complement(&frame[2..end]) != frame[end] {
            return Some(Parsed::BadSum(frame[2]));
        }
        Some(Parsed::Instruction(Instruction {
            id: frame[2],
            code: frame[4],
            params: frame[5..end].to_vec(),
        }))
    }

    fn execute(line: &mut Protocol1Line, packet: Parsed) -> Vec<Burst> {
        let Instruction { id, code, params } = match packet {
            Parsed::BadSum(id) => {
                line.bad_packets += 1;
                let index = line.find_all(id).first().copied();
                // Feetech's servos say nothing to a damaged instruction.
                let index = index.filter(|&i| !line.servos[i].layout.sync_read);
                return index.map_or_else(Vec::new, |i| vec![line.reply(i, CHECKSUM_ERROR, &[])]);
            }
            Parsed::Instruction(instruction) => instruction,
        };
        line.packets_in += 1;
        match code {
            code::SYNC_READ => line.sync_read(&params),
            code::BULK_READ => line.bulk_read(&params),
            code::SYNC_WRITE => line.sync_write(&params),
            code::PING if id == BROADCAST => line.broadcast_ping(),
            _ if id == BROADCAST => {
                for index in line.listeners() {
                    line.single(index, code, &params);
                }
                Vec::new()
            }
            _ => {
                let addressed = line.find_all(id).into_iter();
                let answers = addressed.filter_map(|i| line.single(i, code, &params));
                collided(answers.collect())
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
