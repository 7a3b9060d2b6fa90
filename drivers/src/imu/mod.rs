//! Motion sensors on a robot: the `[imu]` table of a robot file, and the boards that are
//! read beside its servos, on a bus of theirs or on a serial port of their own.
//!
//! A reading reaches the control loop in the axes of the root link
//! ([`servodance_types::ImuState`]). A board that does not answer is no error of the
//! bus: its last reading counts for 100 ms, then there is none.
//!
//! A kind of board is one file: its bytes, what they mean ([`ImuProtocol`]), and how the
//! simulated one makes them. A new one gets a variant of [`ImuKind`] and its line in
//! `serial_imu.rs`.

pub mod bno055;
pub mod bno085;
mod can_imu;
mod config;
mod freshness;
mod mounting;
pub mod opencr;
mod protocol;
mod reader;
mod serial_imu;
pub mod witmotion;

pub(crate) use can_imu::CanImu;
pub use config::{ImuConfig, ImuKind};
pub use mounting::Mounting;
pub use protocol::ImuProtocol;
pub(crate) use reader::ImuReader;
pub use serial_imu::SerialImu;

use servodance_types::ImuState;

const GRAVITY_M_S2: f64 = 9.80665;

/// Three numbers of 16 bits, the low byte first, from `at` on; zero where there are none.
fn three_words(bytes: &[u8], at: usize) -> [f64; 3] {
    [0, 1, 2].map(|index| {
        let first = at + 2 * index;
        let word = bytes.get(first..first + 2).map_or([0; 2], |two| [two[0], two[1]]);
        f64::from(i16::from_le_bytes(word))
    })
}

/// The same number as a board says it; beyond its range it stays at the end.
fn word(value: f64) -> [u8; 2] {
    (value.round() as i16).to_le_bytes()
}

fn words(values: [f64; 3]) -> [u8; 6] {
    let mut bytes = [0; 6];
    for (place, value) in bytes.chunks_exact_mut(2).zip(values) {
        place.copy_from_slice(&word(value));
    }
    bytes
}

/// A reading in the board's axes, in those of the root link.
fn mounted(board: &ImuState, mounting: &Mounting) -> ImuState {
    ImuState {
        rate_rad_s: mounting.to_link(board.rate_rad_s),
        force_m_s2: mounting.to_link(board.force_m_s2),
        up: mounting.to_link(board.up),
    }
}

/// The root link's motion in the board's axes: what a simulated board measures.
pub fn seen_by_board(link: &ImuState, mounting: &Mounting) -> ImuState {
    ImuState {
        rate_rad_s: mounting.to_board(link.rate_rad_s),
        force_m_s2: mounting.to_board(link.force_m_s2),
        up: mounting.to_board(link.up),
    }
}
