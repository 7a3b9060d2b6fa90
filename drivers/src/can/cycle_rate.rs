//! How many control cycles a second a CAN bus carries.
//!
//! One cycle, by protocol, for N motors (bytes in brackets):
//!
//! | | frames |
//! |---|---|
//! | MIT | N commands [8], N replies [8], 11-bit ids |
//! | RobStride | the same, 29-bit ids |
//! | ODrive | N targets [8], N requests [0], N estimates [8], 11-bit ids |
//! | MyActuator | as MIT, and one motor's errors: request [8] and answer [8] |
//! | moteus | N commands [48], N replies [20], CAN FD, 29-bit ids |
//! | CiA 402 | SYNC [0], heartbeat [1], N targets [6], N actual values [8], 11-bit ids |

use crate::bus::config::BusConfig;
use crate::bus::kind::BusKind;
use crate::can::cycle_frames::CycleBits;
use crate::can::families;
use crate::error::ConfigError;

/// Bits of one cycle of `motors` motors; none for a serial bus.
pub(crate) fn cycle_bits(kind: BusKind, motors: usize) -> CycleBits {
    let none = CycleBits { nominal: 0, worst: 0 };
    families::of_kind(kind).map_or(none, |family| family.cycle_frames().bits(motors))
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
