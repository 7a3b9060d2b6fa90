//! The pace of an input against the wall clock: rate measurement and drift.

use std::time::Instant;

/// Time over which the rate of a device is measured, seconds.
const RATE_WINDOW_S: f64 = 1.0;
/// A measured rate that differs by more than this is another rate.
const RATE_TOLERANCE: f64 = 0.02;
/// Rates that devices have.
const USUAL_RATES_HZ: [u32; 9] =
    [8_000, 16_000, 22_050, 32_000, 44_100, 48_000, 88_200, 96_000, 192_000];
/// Time over which an error of the pace is corrected, seconds.
const TAU_S: f64 = 10.0;
/// Largest change of the playing speed.
const MAX_BEND: f64 = 0.005;
/// Errors of the pace beyond this are jumps, not drift, seconds.
pub(super) const JUMP_S: f64 = 0.05;

/// Speed at which sound that is ahead of the clock by `ahead_s` is played. A jump
/// ahead is a writer that waits for us, and is not corrected.
pub(super) fn playing_speed(ahead_s: f64) -> f64 {
    let late_s = if ahead_s > JUMP_S { 0.0 } else { ahead_s };
    1.0 + (late_s / TAU_S).clamp(-MAX_BEND, MAX_BEND)
}

/// Measures the rate that a device delivers, which may differ from the rate that
/// the device claims. Two measurements must agree.
#[derive(Debug, Default)]
pub(super) struct RateMeter {
    /// Beginning of the window, and the frames in it.
    window: Option<(Instant, usize)>,
    /// A measured rate that differs, until it is confirmed.
    suspect_hz: Option<f64>,
}

impl RateMeter {
    /// Begins a new window at the next block.
    pub(super) fn restart(&mut self) {
        self.window = None;
    }

    /// Takes a block; returns the rate of the device if it is not `nominal_hz`.
    pub(super) fn push(
        &mut self,
        nominal_hz: u32,
        frames: usize,
        captured: Instant,
    ) -> Option<u32> {
        let Some((since, counted)) = &mut self.window else {
            self.window = Some((captured, 0));
            return None;
        };
        *counted += frames;
        let window_s = seconds_between(*since, captured);
        if window_s < RATE_WINDOW_S {
            return None;
        }
        let measured_hz = *counted as f64 / window_s;
        self.window = None;
        let off = |rate_hz: f64| (measured_hz / rate_hz - 1.0).abs();
        let suspect_hz = self.suspect_hz.take();
        if off(f64::from(nominal_hz)) < RATE_TOLERANCE {
            return None;
        }
        if suspect_hz.is_some_and(|suspect| off(suspect) < RATE_TOLERANCE / 2.0) {
            return Some(nearest_usual_rate(measured_hz));
        }
        self.suspect_hz = Some(measured_hz);
        None
    }
}

/// The rate that a device most likely has.
fn nearest_usual_rate(measured_hz: f64) -> u32 {
    let near = |rate: &u32| (measured_hz / f64::from(*rate) - 1.0).abs() < 0.01;
    let usual = USUAL_RATES_HZ.into_iter().find(near);
    usual.unwrap_or((measured_hz.round() as u32).clamp(4_000, 384_000))
}

/// Seconds from one moment to another; negative if the other is earlier.
pub(super) fn seconds_between(from: Instant, to: Instant) -> f64 {
    match to.checked_duration_since(from) {
        Some(after) => after.as_secs_f64(),
        None => -from.duration_since(to).as_secs_f64(),
    }
}
