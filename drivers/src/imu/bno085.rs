//! The BNO085 (BNO080) in its mode UART-RVC: 100 packets a second at 115200 baud, unasked.
//!
//! ```text
//! AA AA index yaw pitch roll ax ay az 0 0 0 sum   0.01 degrees, 0.001 g, the low byte first
//! ```
//!
//! Sum: the low byte of all from the index on. There is no rate: the turn from one packet
//! to the next is taken for it. **Which axes roll and pitch are about** is told in two
//! ways by the data sheet: its words say pitch about y and roll about x, its example has
//! forces that fit pitch about x and roll about y. Whichever fits the forces of the
//! board is taken, the example's until the board leans.
//!
//! Figures from the data sheet (1.3.5.2); nothing was compared with a real board.

use servodance_types::ImuState;

use super::protocol::ImuProtocol;
use super::{GRAVITY_M_S2, three_words, word, words};

const HEAD: u8 = 0xAA;
const PACKET: usize = 19;
const PACKET_S: f64 = 0.01;
/// Packets that were lost between two of which a rate is still taken.
const MOST_LOST: u8 = 4;
/// Share of a packet's misfit in the mean one.
const LEARNED: f64 = 0.02;
const MILLI_G: f64 = 1e-3 * GRAVITY_M_S2;

type Rows = [[f64; 3]; 3];

/// Axes that pitch and roll are about.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Axes {
    /// Pitch about x, roll about y.
    Example,
    /// Pitch about y, roll about x.
    Words,
}

impl Axes {
    /// Rows of the rotation from the board to the world: yaw first, then pitch, then roll.
    fn rotation(self, [yaw, pitch, roll]: [f64; 3]) -> Rows {
        let about_z = turn(2, yaw);
        match self {
            Self::Example => times(&about_z, &times(&turn(0, pitch), &turn(1, roll))),
            Self::Words => times(&about_z, &times(&turn(1, pitch), &turn(0, roll))),
        }
    }
}

/// A rotation about an axis of the board.
fn turn(axis: usize, angle_rad: f64) -> Rows {
    let (sin, cos) = angle_rad.sin_cos();
    let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut rows = [[0.0; 3]; 3];
    rows[axis][axis] = 1.0;
    (rows[next][next], rows[last][last]) = (cos, cos);
    (rows[next][last], rows[last][next]) = (-sin, sin);
    rows
}

fn times(a: &Rows, b: &Rows) -> Rows {
    a.map(|row| [0, 1, 2].map(|column| (0..3).map(|k| row[k] * b[k][column]).sum()))
}

fn transposed(rows: &Rows) -> Rows {
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| rows[column][row]))
}

/// What has come so far.
#[derive(Debug)]
pub struct Bno085 {
    packet: Vec<u8>,
    last: Option<(u8, [Rows; 2])>,
    /// Mean misfit of up and forces, by [`Axes`].
    misfit: [f64; 2],
}

impl Default for Bno085 {
    fn default() -> Self {
        Self { packet: Vec::with_capacity(PACKET), last: None, misfit: [0.0; 2] }
    }
}

impl Bno085 {
    /// Nothing has come yet.
    pub fn new() -> Self {
        Self::default()
    }

    fn read(&mut self, packet: [u8; PACKET]) -> Option<ImuState> {
        let index = packet[2];
        let angles = three_words(&packet, 3).map(|value| (value * 0.01).to_radians());
        let force_m_s2 = three_words(&packet, 9).map(|value| value * MILLI_G);
        let rotations = [Axes::Example, Axes::Words].map(|axes| axes.rotation(angles));
        let size = force_m_s2.iter().map(|part| part * part).sum::<f64>().sqrt().max(1e-9);
        for (misfit, rotation) in self.misfit.iter_mut().zip(&rotations) {
            let off = rotation[2].iter().zip(force_m_s2).map(|(up, force)| up - force / size);
            *misfit += (off.map(|part| part * part).sum::<f64>() - *misfit) * LEARNED;
        }
        let taken = usize::from(self.misfit[1] < self.misfit[0]);
        let (last_index, last) = self.last.replace((index, rotations))?;
        let packets = index.wrapping_sub(last_index);
        if packets == 0 || packets > MOST_LOST {
            return None;
        }
        let [before, now] = [last[taken], rotations[taken]];
        // A small turn in the board's axes: the odd part of its rotation.
        let turned = times(&transposed(&before), &now);
        let per_s = 1.0 / (f64::from(packets) * PACKET_S);
        let odd = |row: usize, column: usize| 0.5 * (turned[row][column] - turned[column][row]);
        Some(ImuState {
            rate_rad_s: [odd(2, 1), odd(0, 2), odd(1, 0)].map(|angle| angle * per_s),
            force_m_s2,
            up: now[2],
        })
    }
}

impl ImuProtocol for Bno085 {
    fn ask(&mut self, _out: &mut Vec<u8>) {}

    fn hear(&mut self, byte: u8) -> Option<ImuState> {
        self.packet.push(byte);
        let in_step = self.packet.iter().take(2).all(|byte| *byte == HEAD);
        if !in_step {
            self.packet.clear();
            return None;
        }
        let packet: [u8; PACKET] = self.packet.as_slice().try_into().ok()?;
        if checksum(&packet[2..PACKET - 1]) == packet[PACKET - 1] {
            self.packet.clear();
            return self.read(packet);
        }
        // Out of step: from the next head on.
        let next = (1..PACKET).find(|&at| packet[at..].iter().take(2).all(|byte| *byte == HEAD));
        self.packet.drain(..next.unwrap_or(PACKET));
        None
    }

    fn restart(&mut self) {
        *self = Self::default();
    }
}

fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
}

/// The packet of a measurement in the board's axes; `yaw_rad` is its heading.
pub fn packet(board: &ImuState, yaw_rad: f64, index: u8) -> [u8; PACKET] {
    let [x, y, z] = board.up;
    let angles = [yaw_rad, y.clamp(-1.0, 1.0).asin(), (-x).atan2(z)];
    let mut packet = [0; PACKET];
    packet[..3].copy_from_slice(&[HEAD, HEAD, index]);
    for (place, angle) in packet[3..9].chunks_exact_mut(2).zip(angles) {
        place.copy_from_slice(&word(angle.to_degrees() * 100.0));
    }
    packet[9..15].copy_from_slice(&words(board.force_m_s2.map(|force| force / MILLI_G)));
    packet[PACKET - 1] = checksum(&packet[2..PACKET - 1]);
    packet
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the data sheet: yaw 0.01, pitch -1.10, roll 20.85 degrees; -371, -20 and
    /// 977 thousandths of gravity.
    const EXAMPLE: [u8; PACKET] = [
        0xAA, 0xAA, 0xDE, 0x01, 0x00, 0x92, 0xFF, 0x25, 0x08, 0x8D, 0xFE, 0xEC, 0xFF, 0xD1, 0x03,
        0x00, 0x00, 0x00, 0xE7,
    ];

    fn heard(reader: &mut Bno085, packet: &[u8]) -> Option<ImuState> {
        packet.iter().filter_map(|byte| reader.hear(*byte)).last()
    }

    #[test]
    fn the_data_sheets_example_leans_as_its_forces_say() {
        let mut reader = Bno085::new();
        assert_eq!(heard(&mut reader, &EXAMPLE), None, "no rate yet");
        let mut next = EXAMPLE;
        (next[2], next[18]) = (0xDF, 0xE8);
        let read = heard(&mut reader, &next).unwrap();
        assert_eq!(read.rate_rad_s, [0.0; 3]);
        let size = read.force_m_s2.iter().map(|part| part * part).sum::<f64>().sqrt();
        for axis in 0..3 {
            assert!((read.up[axis] - read.force_m_s2[axis] / size).abs() < 0.01, "{read:?}");
        }
    }

    #[test]
    fn a_lean_that_grows_is_read_with_its_rate() {
        let at = |time_s: f64| {
            let lean = 0.2 + 1.5 * time_s;
            let up = [0.0, lean.sin(), lean.cos()];
            ImuState { rate_rad_s: [1.5, 0.0, 0.0], force_m_s2: up.map(|part| 9.8 * part), up }
        };
        let mut reader = Bno085::new();
        let mut read = None;
        for index in 0..10_u8 {
            let said = packet(&at(f64::from(index) * PACKET_S), 0.0, index.wrapping_add(250));
            read = heard(&mut reader, &said);
        }
        let (read, truth) = (read.unwrap(), at(0.09));
        assert!((read.rate_rad_s[0] - 1.5).abs() < 0.02, "{read:?}");
        assert!(read.up.iter().zip(truth.up).all(|(a, b)| (a - b).abs() < 2e-4), "{read:?}");
    }

    #[test]
    fn a_board_that_means_the_sheets_words_is_understood_once_it_leans() {
        // Rolled about x by 20 degrees, as the words have it: forces along y.
        let mut said = packet(&ImuState::default(), 0.0, 0);
        said[3..9].copy_from_slice(&words([0.0, 0.0, 2000.0]));
        said[9..15].copy_from_slice(&words([0.0, 342.0, 940.0]));
        let mut reader = Bno085::new();
        let mut read = None;
        for index in 0..20 {
            said[2] = index;
            said[PACKET - 1] = checksum(&said[2..PACKET - 1]);
            read = heard(&mut reader, &said);
        }
        let up = read.unwrap().up;
        assert!(up[0].abs() < 1e-9 && (up[1] - 0.342).abs() < 1e-3, "{up:?}");
    }

    #[test]
    fn damage_costs_a_packet_and_no_more() {
        let board = ImuState { up: [0.0, 0.0, 1.0], ..ImuState::default() };
        let mut bytes = vec![HEAD, 1, HEAD];
        for index in 0..5 {
            let mut said = packet(&board, 0.0, index);
            said[7] ^= if index == 2 { 0x55 } else { 0 };
            bytes.extend(said);
        }
        let mut reader = Bno085::new();
        let read = bytes.iter().filter_map(|byte| reader.hear(*byte)).count();
        assert_eq!(read, 3);
    }
}
