//! How many cycles a second a wire carries: the check before any torque.
//!
//! CAN buses are in [`crate::can`]. On a serial one a byte takes ten bits. One cycle is a Sync Write of N goals and a Sync Read
//! of N states.
//!
//! | | goals out | request | reply fast | reply plain |
//! |---|---|---|---|---|
//! | Dynamixel 2.0 | 14 + N(1 + 4) | 14 + N | 8 + N(10 + 4) | N(11 + 10) |
//! | Dynamixel 1.0 | 8 + N(1 + 2) | 7 + 3N | | N(6 + 8), each asked by itself (AX) N(8 + 6 + 8) |
//! | Feetech | 8 + N(1 + 2) | 8 + N | | N(6 + 15) |

use crate::can::{check_can_rate, cycle_bits};
use crate::config::{BusConfig, BusKind};
use crate::error::ConfigError;
use crate::servo::Servo;

/// What a bus can carry. On CAN "fast" is without stuff bits, "plain" with the
/// most there can be, and bytes are eight bits of the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateCheck {
    /// Bytes of one cycle with Fast Sync Read.
    pub fast_bytes: usize,
    /// Bytes of one cycle with plain Sync Read.
    pub plain_bytes: usize,
    /// Most cycles a second with Fast Sync Read.
    pub fast_hz: f64,
    /// Most cycles a second with plain Sync Read.
    pub plain_hz: f64,
}

/// Cycles of `bytes` bytes a second on a serial wire.
pub(crate) fn bytes_hz(baud: u32, bytes: usize) -> f64 {
    f64::from(baud) / (10.0 * bytes as f64)
}

/// Bytes of one cycle of `servos` servos, with the fast read and with the plain one.
pub fn cycle_bytes(kind: BusKind, servos: usize) -> (usize, usize) {
    match kind {
        BusKind::Dynamixel2 => {
            let out = 14 + servos * 5 + 14 + servos;
            (out + 8 + servos * 14, out + servos * 21)
        }
        // With an AX among them each is asked by itself.
        BusKind::Dynamixel1 => {
            let out = 8 + servos * 3;
            (out + 7 + servos * 3 + servos * 14, out + servos * 22)
        }
        BusKind::Feetech => {
            let bytes = 8 + servos * 3 + 8 + servos + servos * 21;
            (bytes, bytes)
        }
        can => {
            let bits = cycle_bits(can, servos);
            (bits.nominal as usize / 8, bits.worst as usize / 8)
        }
    }
}

/// Refuses a control rate that the wire cannot carry even with the fast read;
/// whether the servos know that read is seen when arming.
pub fn check_rate(
    bus: &BusConfig,
    servos: &[Servo],
    control_hz: f64,
) -> Result<RateCheck, ConfigError> {
    let (mut fast_bytes, plain_bytes) = cycle_bytes(bus.kind, servos.len());
    let singly = servos.iter().any(|servo| !servo.model.bulk_read);
    if bus.kind == BusKind::Dynamixel1 && singly {
        fast_bytes = plain_bytes;
    }
    if bus.kind.is_can() {
        let (fast_hz, plain_hz) = check_can_rate(bus, servos.len(), control_hz)?;
        return Ok(RateCheck {
            fast_bytes,
            plain_bytes,
            fast_hz,
            plain_hz,
        });
    }
    let check = RateCheck {
        fast_bytes,
        plain_bytes,
        fast_hz: bytes_hz(bus.baud, fast_bytes),
        plain_hz: bytes_hz(bus.baud, plain_bytes),
    };
    if control_hz > check.fast_hz || !control_hz.is_finite() {
        return Err(ConfigError::Rate {
            servos: servos.len(),
            baud: bus.baud,
            limit_hz: check.fast_hz,
            bytes: fast_bytes,
            asked_hz: control_hz,
        });
    }
    Ok(check)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_servos_match_the_published_limits() {
        assert_eq!(cycle_bytes(BusKind::Dynamixel2, 20), (436, 568));
        let hz = |baud: f64| (baud / 4360.0).round();
        assert_eq!((hz(1e6), hz(2e6), hz(4e6)), (229.0, 459.0, 917.0));
    }
}
