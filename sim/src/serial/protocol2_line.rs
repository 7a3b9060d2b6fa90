//! Servos on one wire that speak Dynamixel Protocol 2.0.
//!
//! Servos of one bus share a line, so a reply to a Sync or Bulk Read waits for
//! the one before it. A servo that is missing from the list breaks that chain:
//! those behind it wait for it and stay silent, as real ones do.

use servodance_drivers::serial::dynamixel2::registers as at;
use servodance_drivers::serial::instruction as code;

use crate::bus::line::Burst;
use crate::serial::imu_board::ImuBoard;
use crate::serial::protocol2_packet::{
    BROADCAST, Instruction, Parsed, Parser, fast_status, status,
};
use crate::serial::serial_line::{LineProtocol, LineServo, SerialLine, collided};
use crate::servo::dynamixel2::XServo;
use crate::servo::dynamixel2::table::AccessError;

const RESULT_FAIL: u8 = 1;
const INSTRUCTION_ERROR: u8 = 2;
const CRC_ERROR: u8 = 3;
const LENGTH_ERROR: u8 = 5;

const LONGEST_READ: usize = 1024;

enum Restart {
    Reboot,
    Restore,
    /// Everything (0xFF), all but the id (1), all but id and baud (2).
    Factory(u8),
}

struct ReadPart {
    id: u8,
    address: u16,
    size: u16,
}

impl ReadPart {
    /// The same as an instruction of its own.
    fn as_read(&self) -> Instruction {
        let params = [self.address.to_le_bytes(), self.size.to_le_bytes()].concat();
        Instruction { id: self.id, code: code::READ, params }
    }
}

/// Servos that speak Dynamixel Protocol 2.0, and a board with a motion sensor if there is one.
pub type Protocol2Line = SerialLine<XServo>;

impl Protocol2Line {
    fn dispatch(&mut self, instruction: &Instruction) -> Vec<Burst> {
        let params = &instruction.params;
        match instruction.code {
            code::SYNC_READ => self.chain(&sync_parts(params)),
            code::BULK_READ => self.chain(&bulk_parts(params)),
            code::FAST_SYNC_READ => self.fast_chain(&sync_parts(params)),
            code::FAST_BULK_READ => self.fast_chain(&bulk_parts(params)),
            code::SYNC_WRITE => self.sync_write(params),
            code::BULK_WRITE => self.bulk_write(params),
            _ if instruction.id == BROADCAST => self.broadcast(instruction),
            _ => {
                let addressed = self.find_all(instruction.id).into_iter();
                let answers = addressed.filter_map(|i| self.single(i, instruction));
                let mut answers: Vec<Burst> = answers.collect();
                answers.extend(self.ask_board(instruction));
                collided(answers)
            }
        }
    }

    /// The board, if a packet to this id reaches it.
    fn board(&mut self, id: u8) -> Option<&mut ImuBoard> {
        let is_heard = self.is_at_line_rate();
        self.board.as_mut().filter(|board| is_heard && board.hears(id))
    }

    fn board_reply(&self, error: u8, params: &[u8]) -> Option<Burst> {
        let board = self.board.as_ref()?;
        let bytes = status(board.id(), error, params);
        Some(Burst { servo: self.servos.len(), delay_s: board.return_delay_s(), bytes })
    }

    /// An instruction to the board, and its answer if its return level gives one.
    fn ask_board(&mut self, instruction: &Instruction) -> Option<Burst> {
        let params = &instruction.params[..];
        let board = self.board(instruction.id)?;
        let level = board.return_level();
        let read = match (instruction.code, params) {
            (code::PING, _) => {
                let data = board.ping();
                return self.board_reply(0, &data);
            }
            (code::READ, &[a0, a1, s0, s1]) => {
                let (address, size) = (u16::from_le_bytes([a0, a1]), u16::from_le_bytes([s0, s1]));
                board.read(address, size).map_err(|error| error as u8)
            }
            (code::READ, _) => Err(LENGTH_ERROR),
            (code::WRITE, _) => {
                let done = |address, data: &[u8]| {
                    board.write(address, data).err().map_or(0, |error| error as u8)
                };
                match addressed(params, done) {
                    0 => Ok(Vec::new()),
                    error => Err(error),
                }
            }
            _ => Err(INSTRUCTION_ERROR),
        };
        let answers = level >= if instruction.code == code::READ { 1 } else { 2 };
        match read {
            _ if !answers => None,
            Ok(data) => self.board_reply(0, &data),
            Err(error) => self.board_reply(error, &[]),
        }
    }

    fn find(&self, id: u8) -> Option<usize> {
        self.find_all(id).first().copied()
    }

    fn reply(&self, index: usize, error: u8, params: &[u8]) -> Burst {
        self.reply_from(self.servos[index].id(), index, error, params)
    }

    fn reply_from(&self, id: u8, index: usize, error: u8, params: &[u8]) -> Burst {
        let servo = &self.servos[index];
        Burst {
            servo: index,
            delay_s: servo.return_delay_s(),
            bytes: status(id, error | servo.alert_bit(), params),
        }
    }

    fn broadcast(&mut self, instruction: &Instruction) -> Vec<Burst> {
        if instruction.code == code::PING {
            let mut order = self.listeners();
            order.sort_by_key(|&index| self.servos[index].id());
            let answers = order.into_iter();
            let mut answers: Vec<(u8, Burst)> = answers
                .map(|index| {
                    let servo = &self.servos[index];
                    (servo.id(), self.reply(index, 0, &servo.ping()))
                })
                .collect();
            if let Some(id) = self.board.as_ref().map(ImuBoard::id) {
                let ping = Instruction { id, ..instruction.clone() };
                answers.extend(self.ask_board(&ping).map(|answer| (id, answer)));
                answers.sort_by_key(|(id, _)| *id);
            }
            return answers.into_iter().map(|(_, answer)| answer).collect();
        }
        // The rest is carried out without an answer; a broadcast Read means nothing.
        let is_read = instruction.code == code::READ;
        // Firmware from 42 on keeps ids when everyone is told to forget everything.
        let forgets_all = instruction.code == code::FACTORY_RESET && instruction.params == [0xFF];
        for index in self.listeners() {
            if !is_read && !forgets_all {
                self.single(index, instruction);
            }
        }
        Vec::new()
    }

    /// An instruction to one servo, and its answer if its return level gives one.
    fn single(&mut self, index: usize, instruction: &Instruction) -> Option<Burst> {
        let params = &instruction.params[..];
        let level = self.servos[index].return_level();
        // A new id is in force from the next instruction on.
        let asked_as = self.servos[index].id();
        let servo = &mut self.servos[index];
        let done = |result: Result<(), AccessError>| result.err().map_or(0, |error| error as u8);
        let mut restart = None;
        let error = match instruction.code {
            code::PING => {
                let data = servo.ping();
                return Some(self.reply(index, 0, &data));
            }
            code::READ => {
                let reply = match *params {
                    [a0, a1, s0, s1] => {
                        let address = u16::from_le_bytes([a0, a1]);
                        let read = servo.read(address, u16::from_le_bytes([s0, s1]));
                        read.map_err(|error| error as u8)
                    }
                    _ => Err(LENGTH_ERROR),
                };
                return (level >= 1).then(|| match reply {
                    Ok(data) => self.reply(index, 0, &data),
                    Err(error) => self.reply(index, error, &[]),
                });
            }
            code::WRITE => addressed(params, |address, data| done(servo.write(address, data))),
            code::REG_WRITE => {
                addressed(params, |address, data| done(servo.register(address, data)))
            }
            code::ACTION if servo.act() => 0,
            code::CLEAR if *params == [0x01, 0x44, 0x58, 0x4C, 0x22] => {
                u8::from(!servo.clear_turns())
            }
            code::BACKUP if *params == [0x01, 0x43, 0x54, 0x52, 0x4C] => u8::from(!servo.back_up()),
            code::BACKUP if *params == [0x02, 0x43, 0x54, 0x52, 0x4C] && servo.has_backup() => {
                restart = Some(Restart::Restore);
                0
            }
            code::BACKUP => RESULT_FAIL,
            code::REBOOT => {
                restart = Some(Restart::Reboot);
                0
            }
            code::FACTORY_RESET if matches!(params, [0xFF | 1 | 2]) => {
                restart = Some(Restart::Factory(params[0]));
                0
            }
            _ => INSTRUCTION_ERROR,
        };
        // The answer leaves before the memory goes.
        let burst = (level >= 2).then(|| self.reply_from(asked_as, index, error, &[]));
        match restart {
            Some(Restart::Reboot) => self.servos[index].reboot(),
            Some(Restart::Restore) => self.servos[index].restore_backup(),
            Some(Restart::Factory(kind)) => {
                self.servos[index].factory_reset(kind != 0xFF, kind == 2);
            }
            None => {}
        }
        burst
    }

    /// Status packets one after the other, up to the first servo that is missing.
    fn chain(&mut self, parts: &[ReadPart]) -> Vec<Burst> {
        let mut bursts = Vec::with_capacity(parts.len());
        for part in parts {
            let Some(index) = self.find(part.id) else {
                match self.ask_board(&part.as_read()) {
                    Some(answer) => bursts.push(answer),
                    None => break,
                }
                continue;
            };
            if self.servos[index].return_level() == 0 {
                break;
            }
            let mut answers = Vec::with_capacity(1);
            for index in self.find_all(part.id) {
                answers.push(match self.servos[index].read(part.address, part.size) {
                    Ok(data) => self.reply(index, 0, &data),
                    Err(error) => self.reply(index, error as u8, &[]),
                });
            }
            bursts.extend(collided(answers));
        }
        bursts
    }

    /// One status packet that the servos send piece by piece.
    fn fast_chain(&mut self, parts: &[ReadPart]) -> Vec<Burst> {
        let mut blocks = Vec::with_capacity(parts.len());
        let mut speakers = Vec::with_capacity(parts.len());
        for part in parts {
            let Some(index) = self.find(part.id) else {
                break;
            };
            let servo = &mut self.servos[index];
            let too_long = usize::from(part.size) > LONGEST_READ;
            if !servo.knows_fast_reads() || servo.return_level() == 0 || too_long {
                break;
            }
            // A refused read still fills its place in the packet.
            let (error, data) = match servo.read(part.address, part.size) {
                Ok(data) => (0, data),
                Err(error) => (error as u8, vec![0; usize::from(part.size)]),
            };
            blocks.push((error | servo.alert_bit(), part.id, data));
            speakers.push(index);
        }
        let announced = 1 + parts.iter().map(|part| usize::from(part.size) + 4).sum::<usize>();
        let first_delay_s =
            speakers.first().map_or(0.0, |&index| self.servos[index].return_delay_s());
        fast_status(&blocks, announced)
            .into_iter()
            .zip(speakers)
            .enumerate()
            .map(|(place, (bytes, servo))| Burst {
                servo,
                delay_s: if place == 0 { first_delay_s } else { 0.0 },
                bytes,
            })
            .collect()
    }

    fn sync_write(&mut self, params: &[u8]) -> Vec<Burst> {
        let Some((&[a0, a1, s0, s1], rest)) = params.split_first_chunk() else {
            return Vec::new();
        };
        let address = u16::from_le_bytes([a0, a1]);
        let size = usize::from(u16::from_le_bytes([s0, s1]));
        for item in rest.chunks_exact(1 + size) {
            if let Some(board) = self.board(item[0]) {
                let _ = board.write(address, &item[1..]);
            }
            for index in self.find_all(item[0]) {
                // Refused writes of a broadcast are not answered.
                let _ = self.servos[index].write(address, &item[1..]);
            }
        }
        Vec::new()
    }

    fn bulk_write(&mut self, params: &[u8]) -> Vec<Burst> {
        let mut rest = params;
        while let Some((&[id, a0, a1, s0, s1], tail)) = rest.split_first_chunk() {
            let size = usize::from(u16::from_le_bytes([s0, s1]));
            let Some((data, after)) = tail.split_at_checked(size) else {
                break;
            };
            if let Some(board) = self.board(id) {
                let _ = board.write(u16::from_le_bytes([a0, a1]), data);
            }
            for index in self.find_all(id) {
                let _ = self.servos[index].write(u16::from_le_bytes([a0, a1]), data);
            }
            rest = after;
        }
        Vec::new()
    }
}

impl LineProtocol for XServo {
    type Parser = Parser;

    fn goals(_: &Protocol2Line, packet: &Parsed) -> Vec<u8> {
        let Parsed::Instruction(Instruction { code: code::SYNC_WRITE, params, .. }) = packet else {
            return Vec::new();
        };
        let goal = at::GOAL_POSITION.address.to_le_bytes();
        match params.split_first_chunk() {
            Some((&[a0, a1, s0, s1], items)) if [a0, a1] == goal => {
                let size = usize::from(u16::from_le_bytes([s0, s1]));
                items.chunks_exact(1 + size).map(|item| item[0]).collect()
            }
            _ => Vec::new(),
        }
    }

    fn parse(parser: &mut Parser, byte: u8) -> Option<Parsed> {
        parser.push(byte)
    }

    fn execute(line: &mut Protocol2Line, packet: Parsed) -> Vec<Burst> {
        match packet {
            Parsed::BadSum(id) => {
                line.bad_packets += 1;
                let addressed = line.find(id).filter(|&i| line.servos[i].return_level() >= 2);
                addressed.map_or_else(Vec::new, |index| vec![line.reply(index, CRC_ERROR, &[])])
            }
            Parsed::Instruction(instruction) => {
                line.packets_in += 1;
                for index in line.listeners() {
                    line.servos[index].feed_watchdog();
                }
                line.dispatch(&instruction)
            }
        }
    }
}

/// Splits an address off and hands on the rest; the status error.
fn addressed(params: &[u8], then: impl FnOnce(u16, &[u8]) -> u8) -> u8 {
    match params.split_first_chunk() {
        Some((&[low, high], data)) => then(u16::from_le_bytes([low, high]), data),
        None => LENGTH_ERROR,
    }
}

fn sync_parts(params: &[u8]) -> Vec<ReadPart> {
    let Some((&[a0, a1, s0, s1], ids)) = params.split_first_chunk() else {
        return Vec::new();
    };
    let address = u16::from_le_bytes([a0, a1]);
    let size = u16::from_le_bytes([s0, s1]);
    ids.iter().map(|&id| ReadPart { id, address, size }).collect()
}

fn bulk_parts(params: &[u8]) -> Vec<ReadPart> {
    params
        .chunks_exact(5)
        .map(|item| ReadPart {
            id: item[0],
            address: u16::from_le_bytes([item[1], item[2]]),
            size: u16::from_le_bytes([item[3], item[4]]),
        })
        .collect()
}
