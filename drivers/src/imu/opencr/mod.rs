//! The OpenCR board of OP3: a node with id 200 on the servos' Dynamixel 2 bus, whose
//! memory begins as a servo's does not (`registers`).
//!
//! It knows Read, Write, Sync Read and Bulk Read and no fast read, so it is read by
//! itself, after the servos: 43 bytes of the wire a cycle. Its firmware turns rates,
//! forces and attitude into whole numbers as [`encode`] does. On OP3 it is mounted
//! with its x and y backwards (`mounting_deg = [0, 0, 180]`).
//!
//! Figures from the vendor's public sources; nothing was compared with a real board.

pub mod registers;

use servodance_types::ImuState;

use super::mounting::Mounting;

/// Whole numbers a degree a second, an acceleration of gravity, a degree.
const PER_DEG_S: f64 = 16.4;
const PER_GRAVITY: f64 = 16384.0;
const PER_DEG: f64 = 10.0;
const GRAVITY_M_S2: f64 = 9.80665;

/// Its id as it leaves the factory.
pub const FACTORY_ID: u8 = 200;

/// How many bytes a reading has: rates, forces, and roll, pitch, yaw, three words each.
pub const READING_BYTES: usize = registers::READING.size as usize;

fn word(value: f64) -> [u8; 2] {
    // A cast saturates, as the sensor's range does.
    (value.round() as i16).to_le_bytes()
}

/// What the board's registers hold where the root link has this motion.
pub fn encode(state: &ImuState, mounting: &Mounting) -> [u8; READING_BYTES] {
    let rate = mounting.to_board(state.rate_rad_s).map(|rate| rate.to_degrees() * PER_DEG_S);
    let force = mounting.to_board(state.force_m_s2).map(|force| force / GRAVITY_M_S2 * PER_GRAVITY);
    let [x, y, z] = mounting.to_board(state.up);
    let (roll, pitch) = (y.atan2(z), (-x).atan2(y.hypot(z)));
    let attitude = [roll, pitch, 0.0].map(|angle| angle.to_degrees() * PER_DEG);
    let mut bytes = [0; READING_BYTES];
    let values = rate.into_iter().chain(force).chain(attitude);
    for (place, value) in bytes.chunks_exact_mut(2).zip(values) {
        place.copy_from_slice(&word(value));
    }
    bytes
}

/// The motion of the root link that these registers tell. Up comes from roll and pitch:
/// without a compass yaw means nothing.
pub fn decode(bytes: &[u8; READING_BYTES], mounting: &Mounting) -> ImuState {
    let value =
        |index: usize| f64::from(i16::from_le_bytes([bytes[2 * index], bytes[2 * index + 1]]));
    let three = |first: usize, unit: f64| [0, 1, 2].map(|axis| value(first + axis) / unit);
    let (roll_sin, roll_cos) = (value(6) / PER_DEG).to_radians().sin_cos();
    let (pitch_sin, pitch_cos) = (value(7) / PER_DEG).to_radians().sin_cos();
    let up = [-pitch_sin, pitch_cos * roll_sin, pitch_cos * roll_cos];
    ImuState {
        rate_rad_s: mounting.to_link(three(0, PER_DEG_S).map(f64::to_radians)),
        force_m_s2: mounting.to_link(three(3, PER_GRAVITY / GRAVITY_M_S2)),
        up: mounting.to_link(up),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_hold_what_the_vendors_units_say() {
        // Level, turning left by 10 degrees a second, on OP3's mounting.
        let state = ImuState {
            rate_rad_s: [0.0, 0.0, 10f64.to_radians()],
            force_m_s2: [0.0, 0.0, GRAVITY_M_S2],
            up: [0.0, 0.0, 1.0],
        };
        let bytes = encode(&state, &Mounting::from_deg([0.0, 0.0, 180.0]));
        let mut expected = [0; READING_BYTES];
        expected[4..6].copy_from_slice(&164i16.to_le_bytes());
        expected[10..12].copy_from_slice(&16384i16.to_le_bytes());
        assert_eq!(bytes, expected);
    }

    #[test]
    fn a_reading_comes_back_to_the_sensors_resolution() {
        let mounting = Mounting::from_deg([0.0, 0.0, 180.0]);
        let (sin, cos) = 0.2f64.sin_cos();
        let state = ImuState {
            rate_rad_s: [0.5, -1.0, 2.0],
            force_m_s2: [1.0, -2.0, 9.0],
            up: [sin * 0.6, sin * 0.8, cos],
        };
        let back = decode(&encode(&state, &mounting), &mounting);
        let near =
            |a: [f64; 3], b: [f64; 3], most| a.iter().zip(b).all(|(a, b)| (a - b).abs() < most);
        assert!(near(back.rate_rad_s, state.rate_rad_s, 1e-3), "{back:?}");
        assert!(near(back.force_m_s2, state.force_m_s2, 1e-3), "{back:?}");
        assert!(near(back.up, state.up, 2e-3), "{back:?}");
    }

    #[test]
    fn what_is_beyond_the_range_stays_at_its_end() {
        let state =
            ImuState { rate_rad_s: [1e3, -1e3, 0.0], force_m_s2: [0.0; 3], up: [0.0, 0.0, 1.0] };
        let bytes = encode(&state, &Mounting::from_deg([0.0; 3]));
        assert_eq!(bytes[..4], [0xFF, 0x7F, 0x00, 0x80]);
    }
}
