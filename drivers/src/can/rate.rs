//! How many control cycles a second a CAN bus carries.
//!
//! One cycle, by protocol, for N motors (bytes in brackets):
//!
//! | | frames |
//! |---|---|
//! | MIT | N commands [8], N replies [8], 11-bit ids |
//! | RobStride | the same, 29-bit ids |
//! | ODrive | N targets [8], N requests [0], N estimates [8], 11-bit ids |
//! | CiA 402 | SYNC [0], heartbeat [1], N targets [6], N actual values [8], 11-bit ids |

use crate::can::frame::{nominal_bits, worst_bits};
use crate::error::ConfigError;
use crate::{BusConfig, BusKind};

/// Bits of one cycle on the wire, pauses between frames included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CycleBits {
    /// No stuff bits.
    pub nominal: u32,
    /// As many stuff bits as there can be.
    pub worst: u32,
}

/// Bits of one cycle of `motors` motors; none for a serial bus.
pub fn cycle_bits(kind: BusKind, motors: usize) -> CycleBits {
    let (extended, once, each): (_, &[usize], &[usize]) = match kind {
        BusKind::Mit => (false, &[], &[8, 8]),
        BusKind::Robstride => (true, &[], &[8, 8]),
        BusKind::Odrive => (false, &[], &[8, 0, 8]),
        BusKind::Cia402 => (false, &[0, 1], &[6, 8]),
        _ => (false, &[], &[]),
    };
    let sum = |bits: fn(bool, usize) -> u32| {
        let total = |sizes: &[usize]| sizes.iter().map(|&size| bits(extended, size)).sum::<u32>();
        total(once) + total(each) * motors as u32
    };
    CycleBits {
        nominal: sum(nominal_bits),
        worst: sum(worst_bits),
    }
}

/// Refuses more cycles a second than the bus carries without a single stuff bit.
pub(crate) fn check_can_rate(
    bus: &BusConfig,
    motors: usize,
    control_hz: f64,
) -> Result<(f64, f64), ConfigError> {
    let bits = cycle_bits(bus.kind, motors);
    let hz = |bits: u32| f64::from(bus.baud) / f64::from(bits);
    let (nominal_hz, worst_hz) = (hz(bits.nominal), hz(bits.worst));
    if control_hz > nominal_hz || !control_hz.is_finite() {
        return Err(ConfigError::CanRate {
            motors,
            bitrate: bus.baud,
            nominal_hz,
            worst_hz,
            bits: bits.nominal,
            asked_hz: control_hz,
        });
    }
    Ok((nominal_hz, worst_hz))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_limits_at_one_megabit() {
        let hz = |kind, motors| {
            let bits = cycle_bits(kind, motors);
            [bits.nominal, bits.worst].map(|bits| (1e6 / f64::from(bits)).round())
        };
        assert_eq!(hz(BusKind::Mit, 12), [375.0, 309.0]);
        assert_eq!(hz(BusKind::Mit, 20), [225.0, 185.0]);
        assert_eq!(hz(BusKind::Robstride, 12), [318.0, 260.0]);
        assert_eq!(hz(BusKind::Robstride, 20), [191.0, 156.0]);
    }

    #[test]
    fn too_fast_is_refused_with_the_numbers() {
        let bus = BusConfig::of_kind(BusKind::Mit, 1_000_000);
        assert!(check_can_rate(&bus, 20, 225.0).is_ok());
        let error = check_can_rate(&bus, 20, 250.0).unwrap_err().to_string();
        assert_eq!(
            error,
            "20 motors on CAN at 1000000 bit/s carry at most 225 cycles a second \
             (4440 bits each; 185 with the most stuff bits), but the robot asks for 250: \
             raise the bitrate, use a second bus, or lower control_hz"
        );
    }
}
