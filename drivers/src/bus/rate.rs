//! How many cycles a second a bus carries: the check before any torque.
//!
//! One cycle is one goal out to each servo and one state back. On a serial bus the
//! bytes are the family's to count, ten bits each; CAN counts bits itself.

use crate::bus::config::BusConfig;
use crate::can::{check_can_rate, cycle_bits};
use crate::error::ConfigError;
use crate::serial::families::family_of;
use crate::serial::wire::port::bytes_hz;
use crate::servo::Servo;

/// What a bus can carry. On CAN "fast" is without stuff bits, "plain" with the
/// most there can be, and bytes are eight bits of the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateCheck {
    /// Bytes of one cycle with the quickest read, Fast Sync Read for instance.
    pub fast_bytes: usize,
    /// Bytes of one cycle with the plain read.
    pub plain_bytes: usize,
    /// Most cycles a second with the quickest read.
    pub fast_hz: f64,
    /// Most cycles a second with the plain read.
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
    let bytes = family.cycle_bytes(servos);
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
