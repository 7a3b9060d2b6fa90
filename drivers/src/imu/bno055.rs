//! The BNO055 on its serial interface: registers, asked for at 115200 baud.
//!
//! ```text
//! read   AA 01 register length         answer BB length data, or EE status
//! write  AA 00 register length data    answer EE status (1: written)
//! ```
//!
//! The board is set to its mode `IMU` (accelerometer and gyroscope, no compass), then 32
//! bytes are read a cycle: rates, attitude, acceleration without gravity, gravity. An
//! answer comes in the cycle after the question. A board that was without power forgets
//! its mode and is set up again. Status 7 (overrun) comes now and then while the board
//! reckons: the question is asked again.
//!
//! Figures from the data sheet (4.2 to 4.7); nothing was compared with a real board.

use servodance_types::ImuState;

use super::protocol::ImuProtocol;
use super::{three_words, words};

/// Registers that are used, and what is in them.
pub mod registers {
    /// Reads 0xA0.
    pub const CHIP_ID: u8 = 0x00;
    /// What `CHIP_ID` reads.
    pub const CHIP: u8 = 0xA0;
    /// Rates; from here on a reading is taken.
    pub const READING: u8 = 0x14;
    /// Units of all readings.
    pub const UNITS: u8 = 0x3B;
    /// m/s2, degrees a second, degrees, Celsius.
    pub const METRIC: u8 = 0x00;
    /// Mode of operation.
    pub const MODE: u8 = 0x3D;
    /// Nothing is measured; units can be set.
    pub const CONFIG: u8 = 0x00;
    /// Accelerometer and gyroscope together.
    pub const IMU: u8 = 0x08;
}
use registers as at;

/// Bytes of a reading: rates 0, attitude 6, quaternion 12, free acceleration 20, gravity 26.
pub const READING_BYTES: usize = 32;
const FREE: usize = 20;
const GRAVITY: usize = 26;
/// The first byte of a question, of data, of a status.
pub const QUESTION: u8 = 0xAA;
/// See [`QUESTION`].
pub const DATA: u8 = 0xBB;
/// See [`QUESTION`].
pub const STATUS: u8 = 0xEE;
/// Status: it was written.
pub const WRITTEN: u8 = 1;

/// Whole numbers a degree a second, and a m/s2.
const PER_DEG_S: f64 = 16.0;
const PER_M_S2: f64 = 100.0;
/// Cycles that an answer may take, and that a change of mode does.
const PATIENCE: u32 = 3;

/// What is done next.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Identify,
    Configure,
    SetUnits,
    Start,
    Measure,
}

/// The board as its driver sees it.
#[derive(Debug)]
pub struct Bno055 {
    step: Step,
    /// Cycles since the question; `None`: it was answered.
    asked: Option<u32>,
    answer: Vec<u8>,
}

impl Default for Bno055 {
    fn default() -> Self {
        Self { step: Step::Identify, asked: None, answer: Vec::with_capacity(2 + READING_BYTES) }
    }
}

impl Bno055 {
    /// A board that has to be set up.
    pub fn new() -> Self {
        Self::default()
    }

    fn question(&self) -> Vec<u8> {
        let write = |register: u8, value: u8| vec![QUESTION, 0, register, 1, value];
        match self.step {
            Step::Identify => vec![QUESTION, 1, at::CHIP_ID, 1],
            Step::Configure => write(at::MODE, at::CONFIG),
            Step::SetUnits => write(at::UNITS, at::METRIC),
            Step::Start => write(at::MODE, at::IMU),
            Step::Measure => vec![QUESTION, 1, at::READING, READING_BYTES as u8],
        }
    }

    /// A whole answer.
    fn take(&mut self) -> Option<ImuState> {
        let answer = std::mem::take(&mut self.answer);
        self.asked = None;
        let next = match (self.step, answer.as_slice()) {
            (Step::Identify, [DATA, 1, at::CHIP]) => Step::Configure,
            (Step::Configure, [STATUS, WRITTEN]) => Step::SetUnits,
            (Step::SetUnits, [STATUS, WRITTEN]) => Step::Start,
            (Step::Start, [STATUS, WRITTEN]) => Step::Measure,
            (Step::Measure, [DATA, _, reading @ ..]) => {
                let state = decode(reading);
                if state.is_none() {
                    self.step = Step::Identify;
                }
                return state;
            }
            (step, _) => step,
        };
        self.step = next;
        None
    }
}

impl ImuProtocol for Bno055 {
    fn ask(&mut self, out: &mut Vec<u8>) {
        if let Some(cycles) = &mut self.asked {
            *cycles += 1;
            if *cycles < PATIENCE {
                return;
            }
        }
        self.answer.clear();
        self.asked = Some(0);
        out.extend(self.question());
    }

    fn hear(&mut self, byte: u8) -> Option<ImuState> {
        if self.answer.is_empty() && !matches!(byte, DATA | STATUS) {
            return None;
        }
        self.answer.push(byte);
        let whole = match self.answer[..] {
            [STATUS, _] => true,
            [DATA, length, ..] => self.answer.len() == 2 + usize::from(length),
            _ => false,
        };
        if whole { self.take() } else { None }
    }

    fn restart(&mut self) {
        *self = Self::default();
    }
}

/// What a reading says; `None` where nothing was measured.
fn decode(reading: &[u8]) -> Option<ImuState> {
    if reading.len() != READING_BYTES {
        return None;
    }
    let acceleration = |first: usize| three_words(reading, first).map(|value| value / PER_M_S2);
    let (free, gravity) = (acceleration(FREE), acceleration(GRAVITY));
    let size = gravity.iter().map(|part| part * part).sum::<f64>().sqrt();
    (size > 1.0).then(|| ImuState {
        rate_rad_s: three_words(reading, 0).map(|value| (value / PER_DEG_S).to_radians()),
        force_m_s2: [0, 1, 2].map(|axis| free[axis] + gravity[axis]),
        up: gravity.map(|part| part / size),
    })
}

/// The registers of a reading for a measurement in the board's axes; `yaw_rad` is its heading.
pub fn reading(board: &ImuState, yaw_rad: f64) -> [u8; READING_BYTES] {
    const GRAVITY_M_S2: f64 = super::GRAVITY_M_S2;
    let [x, y, z] = board.up;
    let (roll, pitch) = (y.atan2(z), (-x).atan2(y.hypot(z)));
    let heading = yaw_rad.to_degrees().rem_euclid(360.0);
    let gravity = board.up.map(|part| part * GRAVITY_M_S2);
    let free = [0, 1, 2].map(|axis| board.force_m_s2[axis] - gravity[axis]);
    let mut bytes = [0; READING_BYTES];
    bytes[..6].copy_from_slice(&words(board.rate_rad_s.map(|r| r.to_degrees() * PER_DEG_S)));
    let angles = [heading, roll.to_degrees(), pitch.to_degrees()].map(|angle| angle * 16.0);
    bytes[6..12].copy_from_slice(&words(angles));
    let half = [roll, pitch, yaw_rad].map(|angle| (angle / 2.0).sin_cos());
    let [(sr, cr), (sp, cp), (sy, cy)] = half;
    let [w, i, j, k] = [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
    .map(|part| part * 16384.0);
    bytes[12..14].copy_from_slice(&super::word(w));
    bytes[14..20].copy_from_slice(&words([i, j, k]));
    bytes[FREE..GRAVITY].copy_from_slice(&words(free.map(|part| part * PER_M_S2)));
    bytes[GRAVITY..].copy_from_slice(&words(gravity.map(|part| part * PER_M_S2)));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(board: &mut Bno055) -> Vec<u8> {
        let mut out = Vec::new();
        board.ask(&mut out);
        out
    }

    fn tell(board: &mut Bno055, bytes: &[u8]) -> Option<ImuState> {
        bytes.iter().filter_map(|byte| board.hear(*byte)).last()
    }

    #[test]
    fn the_board_is_set_up_and_read_to_the_byte() {
        let mut board = Bno055::new();
        for (question, answer) in [
            (vec![0xAA, 1, 0x00, 1], vec![0xBB, 1, 0xA0]),
            (vec![0xAA, 0, 0x3D, 1, 0x00], vec![0xEE, 1]),
            (vec![0xAA, 0, 0x3B, 1, 0x00], vec![0xEE, 7]),
            (vec![0xAA, 0, 0x3B, 1, 0x00], vec![0xEE, 1]),
            (vec![0xAA, 0, 0x3D, 1, 0x08], vec![0xEE, 1]),
        ] {
            assert_eq!(asked(&mut board), question);
            assert_eq!(tell(&mut board, &answer), None);
        }
        assert_eq!(asked(&mut board), [0xAA, 1, 0x14, 32]);
        let mut said = vec![0xBB, 32];
        said.extend([0; 32]);
        // 16 degrees a second about z; level.
        said[6..8].copy_from_slice(&256_i16.to_le_bytes());
        said[32..34].copy_from_slice(&981_i16.to_le_bytes());
        let read = tell(&mut board, &said).unwrap();
        assert!((read.rate_rad_s[2] - 16_f64.to_radians()).abs() < 1e-12);
        assert_eq!((read.up, read.force_m_s2[2]), ([0.0, 0.0, 1.0], 9.81));
    }

    #[test]
    fn a_board_that_lost_its_power_is_set_up_again() {
        let mut board = Bno055 { step: Step::Measure, ..Bno055::new() };
        asked(&mut board);
        let mut said = vec![0xBB, 32];
        said.extend([0; 32]);
        assert_eq!(tell(&mut board, &said), None);
        assert_eq!(asked(&mut board), [0xAA, 1, 0x00, 1]);
    }

    #[test]
    fn a_question_without_an_answer_is_asked_again() {
        let mut board = Bno055::new();
        let asked: Vec<usize> = (0..5).map(|_| asked(&mut board).len()).collect();
        assert_eq!(asked, [4, 0, 0, 4, 0]);
    }

    #[test]
    fn a_reading_comes_back_to_the_sensors_resolution() {
        let (sin, cos) = 0.3_f64.sin_cos();
        let board = ImuState {
            rate_rad_s: [0.5, -1.0, 2.0],
            force_m_s2: [1.0, -2.0, 9.0],
            up: [-sin * 0.6, sin * 0.8, cos],
        };
        let read = decode(&reading(&board, 1.0)).unwrap();
        for axis in 0..3 {
            assert!((read.up[axis] - board.up[axis]).abs() < 2e-3, "{read:?}");
            assert!((read.rate_rad_s[axis] - board.rate_rad_s[axis]).abs() < 1e-3, "{read:?}");
            assert!((read.force_m_s2[axis] - board.force_m_s2[axis]).abs() < 2e-2, "{read:?}");
        }
    }
}
