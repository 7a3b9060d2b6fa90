//! Time is passed in, never asked for: tests and `--speed max` advance it by hand.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// A clock that only goes forward, in seconds since its own start.
pub trait Clock: Send + Sync {
    /// Seconds since the clock was made.
    fn now_s(&self) -> f64;
}

/// The machine's monotonic clock.
#[derive(Clone, Debug)]
pub struct WallClock(Instant);

impl WallClock {
    /// A clock that reads zero now.
    pub fn start() -> Self {
        Self(Instant::now())
    }
}

impl Clock for WallClock {
    fn now_s(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}

/// A clock that stands still until somebody advances it. Clones share the time.
#[derive(Clone, Debug, Default)]
pub struct ManualClock(Arc<AtomicU64>);

impl ManualClock {
    /// Sets the time to `seconds`, at nanosecond resolution; never backwards.
    pub fn advance_to_s(&self, seconds: f64) {
        self.0
            .fetch_max((seconds * 1e9).round() as u64, Ordering::AcqRel);
    }
}

impl Clock for ManualClock {
    fn now_s(&self) -> f64 {
        self.0.load(Ordering::Acquire) as f64 * 1e-9
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn manual_clock_never_goes_back() {
        let clock = ManualClock::default();
        let same = clock.clone();
        clock.advance_to_s(1.5);
        clock.advance_to_s(1.0);
        assert_eq!(same.now_s(), 1.5);
    }
}
