//! The simulated BNO055: registers of page 0, read and written one question at a time.
//!
//! It wakes up in its mode `CONFIG`, in which it measures nothing and its units can be
//! set. Not simulated: page 1, calibration, the time that a change of mode takes.

use servodance_drivers::imu::bno055::{
    DATA, QUESTION, READING_BYTES, STATUS, WRITTEN, reading, registers as at,
};

use super::{BoardTwin, Measured};

/// Registers 0x00 to 0x6A.
const SIZE: usize = 0x6B;
const LONGEST: u8 = 128;
/// Statuses that are no success.
const WRITE_FAILED: u8 = 0x03;
const NO_SUCH_REGISTER: u8 = 0x04;
const WRITE_DISABLED: u8 = 0x05;
const WRONG_START: u8 = 0x06;
const TOO_LONG: u8 = 0x08;
const TOO_SHORT: u8 = 0x09;

#[derive(Debug)]
pub(super) struct Bno055Board {
    memory: [u8; SIZE],
    question: Vec<u8>,
}

impl Bno055Board {
    pub fn new() -> Self {
        let mut memory = [0; SIZE];
        // Chip, accelerometer, magnetometer, gyroscope; firmware 3.17, boot loader 0x15.
        memory[..7].copy_from_slice(&[at::CHIP, 0xFB, 0x32, 0x0F, 0x11, 0x03, 0x15]);
        memory[usize::from(at::UNITS)] = 0x80;
        memory[usize::from(at::MODE)] = 0x10;
        Self { memory, question: Vec::new() }
    }

    fn mode(&self) -> u8 {
        self.memory[usize::from(at::MODE)] & 0x0F
    }

    fn answer(&mut self, measured: &Measured, out: &mut Vec<u8>) {
        let question = std::mem::take(&mut self.question);
        let (register, length) = (usize::from(question[2]), question[3]);
        let end = register + usize::from(length);
        let status = match (question[1], length) {
            (_, 0) => TOO_SHORT,
            (_, length) if length > LONGEST => TOO_LONG,
            _ if end > SIZE => NO_SUCH_REGISTER,
            (1, _) => {
                self.measure_into_memory(measured);
                out.extend([DATA, length]);
                return out.extend(&self.memory[register..end]);
            }
            _ => self.write(register, &question[4..]),
        };
        out.extend([STATUS, status]);
    }

    fn write(&mut self, register: usize, data: &[u8]) -> u8 {
        match (register as u8, data) {
            (at::MODE, [mode]) if mode & 0x0F <= 0x0C => self.memory[register] = *mode,
            (at::UNITS, [units]) if self.mode() == at::CONFIG => self.memory[register] = *units,
            (at::UNITS, [_]) => return WRITE_DISABLED,
            _ => return WRITE_FAILED,
        }
        WRITTEN
    }

    fn measure_into_memory(&mut self, measured: &Measured) {
        let place = usize::from(at::READING);
        let bytes = match self.mode() {
            at::CONFIG => [0; READING_BYTES],
            _ => reading(&measured.state, measured.yaw_rad),
        };
        self.memory[place..place + READING_BYTES].copy_from_slice(&bytes);
    }
}

impl BoardTwin for Bno055Board {
    fn hear(&mut self, byte: u8, measured: &Measured, out: &mut Vec<u8>) {
        self.question.push(byte);
        match self.question[..] {
            [QUESTION] | [QUESTION, 0 | 1] | [QUESTION, _, _] => {}
            [QUESTION, 1, _, _] => self.answer(measured, out),
            [QUESTION, 0, _, length, ..] => {
                let data = if length <= LONGEST { usize::from(length) } else { 0 };
                if self.question.len() == 4 + data {
                    self.answer(measured, out);
                }
            }
            _ => {
                self.question.clear();
                out.extend([STATUS, WRONG_START]);
            }
        }
    }

    fn measure(&mut self, _measured: &Measured, _out: &mut Vec<u8>) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imu::LEVEL;

    fn answers(board: &mut Bno055Board, question: &[u8]) -> Vec<u8> {
        let measured = Measured { state: LEVEL, yaw_rad: 0.0 };
        let mut out = Vec::new();
        question.iter().for_each(|byte| board.hear(*byte, &measured, &mut out));
        out
    }

    #[test]
    fn questions_are_answered_to_the_byte() {
        let mut board = Bno055Board::new();
        for (question, answer) in [
            (&[0xAA, 1, 0x00, 2][..], &[0xBB, 2, 0xA0, 0xFB][..]),
            (&[0xAA, 1, 0x2E, 2], &[0xBB, 2, 0, 0]),
            (&[0xAA, 0, 0x3B, 1, 0x00], &[0xEE, 1]),
            (&[0xAA, 0, 0x3D, 1, 0x08], &[0xEE, 1]),
            (&[0xAA, 0, 0x3B, 1, 0x80], &[0xEE, 5]),
            (&[0xAA, 1, 0x2E, 6], &[0xBB, 6, 0, 0, 0, 0, 0xD5, 0x03]),
            (&[0xAA, 1, 0x60, 20], &[0xEE, 4]),
            (&[0xAA, 1, 0x00, 0], &[0xEE, 9]),
            (&[0xAA, 1, 0x00, 200], &[0xEE, 8]),
            (&[0x55], &[0xEE, 6]),
            (&[0xAA, 1, 0x3B, 1], &[0xBB, 1, 0]),
        ] {
            assert_eq!(answers(&mut board, question), answer, "{question:X?}");
        }
    }
}
