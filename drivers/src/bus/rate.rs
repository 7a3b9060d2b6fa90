//! How many cycles a second a bus carries: the check before any torque.
//!
//! One cycle is one goal out to each servo and one state back. On a serial bus the
//! bytes are the family's to count, ten bits each; CAN counts bits itself.

use crate::bus::config::BusConfig;
use crate::can::{check_can_rate, cycle_bits};
use crate::error::ConfigError;
use crate::imu::opencr::READING_BYTES;
use crate::serial::families::family_of;
use crate::serial::wire::port::bytes_hz;
use crate::servo::Servo;

/// A Read of Protocol 2 and its answer: what a motion sensor adds to a cycle.
const IMU_BYTES: usize = 14 + 11 + READING_BYTES;

/// What a bus can carry. On CAN "fast" is without stuff bits, "plain" with the
/// most there can be, and bytes are eight bits of the wire.
#[allow(missing_docs)] // units stand in the names
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateCheck {
    pub fast_bytes: usize,
    pub plain_bytes: usize,
    pub fast_hz: f64,
    pub plain_hz: f64,
}

/// Refuses a control rate that the wire cannot carry even with the fast read;
/// whether the servos know that read is seen when arming.
pub fn check_rate(
    bus: &BusConfig,
    servos: &[Servo],
    control_hz: f64,
) -> Result<RateCheck, ConfigError> {
    let Some(family) = family_of(bus.kind) else {
        let bits = cycle_bits(bus.kind, servos.len());
        let (fast_hz, plain_hz) = check_can_rate(bus, servos.len(), control_hz)?;
        return Ok(RateCheck {
            fast_bytes: bits.nominal as usize / 8,
            plain_bytes: bits.worst as usize / 8,
            fast_hz,
            plain_hz,
        });
    };
    let mut bytes = family.cycle_bytes(servos);
    if bus.imu.is_some() {
        bytes.fast += IMU_BYTES;
        bytes.plain += IMU_BYTES;
    }
    let check = RateCheck {
        fast_bytes: bytes.fast,
        plain_bytes: bytes.plain,
        fast_hz: bytes_hz(bus.baud, bytes.fast),
        plain_hz: bytes_hz(bus.baud, bytes.plain),
    };
    if control_hz > check.fast_hz || !control_hz.is_finite() {
        return Err(ConfigError::Rate {
            servos: servos.len(),
            baud: bus.baud,
            limit_hz: check.fast_hz,
            bytes: bytes.fast,
            asked_hz: control_hz,
        });
    }
    Ok(check)
}
