//! How many cycles a second a wire carries: the check before any torque.
//!
//! A byte takes ten bits. One cycle is a Sync Write of N goals and a Sync Read
//! of N states: `14 + N(1 + 4)` out, then fast `14 + N` out and `8 + N(L + 4)`
//! back, or plain `14 + N` out and `N(11 + L)` back.

use crate::config::BusConfig;
use crate::error::ConfigError;
use crate::register::Register;
use crate::servo::Servo;

/// What a bus can carry.
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

/// Bytes of a Sync Write of `size` bytes to each of `servos`.
pub fn write_bytes(servos: usize, size: usize) -> usize {
    14 + servos * (1 + size)
}

/// Bytes of a read of `size` bytes from each of `servos`, request and reply.
pub fn read_bytes(servos: usize, size: usize, fast: bool) -> usize {
    let request = 14 + servos;
    let reply = if fast {
        8 + servos * (size + 4)
    } else {
        servos * (11 + size)
    };
    request + reply
}

/// Refuses a control rate that the wire cannot carry even with Fast Sync Read.
pub fn check_rate(
    bus: &BusConfig,
    servos: &[Servo],
    control_hz: f64,
) -> Result<RateCheck, ConfigError> {
    let goals = write_bytes(servos.len(), usize::from(Register::GOAL_POSITION.size));
    let state = usize::from(Register::PRESENT.size);
    let hz = |bytes: usize| f64::from(bus.baud) / (10.0 * bytes as f64);
    let fast_bytes = goals + read_bytes(servos.len(), state, true);
    let plain_bytes = goals + read_bytes(servos.len(), state, false);
    let check = RateCheck {
        fast_bytes,
        plain_bytes,
        fast_hz: hz(fast_bytes),
        plain_hz: hz(plain_bytes),
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
        let cycle = write_bytes(20, 4) + read_bytes(20, 10, true);
        assert_eq!(cycle, 436);
        assert_eq!(write_bytes(20, 4) + read_bytes(20, 10, false), 568);
        assert_eq!((4e6 / (10.0 * cycle as f64)).round(), 917.0);
    }
}
