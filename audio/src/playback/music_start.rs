//! When the music begins, by the clock on the wall: one number, written by the control loop
//! and read by the sound callback.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Instant;

/// No music: nothing is heard.
const SILENT: i64 = i64::MIN;

/// Shared by the control loop and the sound callback; clones are the same clock.
#[derive(Clone, Debug)]
pub struct MusicStart {
    epoch: Instant,
    begins_ns: Arc<AtomicI64>,
}

impl Default for MusicStart {
    fn default() -> Self {
        Self { epoch: Instant::now(), begins_ns: Arc::new(AtomicI64::new(SILENT)) }
    }
}

impl MusicStart {
    /// The music begins at `moment`, or began then.
    pub fn set(&self, moment: Instant) {
        self.begins_ns.store(self.nanoseconds(moment), Ordering::Release);
    }

    /// The music is over.
    pub fn silence(&self) {
        self.begins_ns.store(SILENT, Ordering::Release);
    }

    /// Seconds of music at `moment`, negative before it begins; `None` in silence.
    pub fn music_s(&self, moment: Instant) -> Option<f64> {
        match self.begins_ns.load(Ordering::Acquire) {
            SILENT => None,
            begins_ns => Some((self.nanoseconds(moment) - begins_ns) as f64 * 1e-9),
        }
    }

    fn nanoseconds(&self, moment: Instant) -> i64 {
        match moment.checked_duration_since(self.epoch) {
            Some(after) => after.as_nanos() as i64,
            None => -(self.epoch.duration_since(moment).as_nanos() as i64),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn music_runs_with_the_clock_on_the_wall() {
        let start = MusicStart::default();
        let now = Instant::now();
        assert_eq!(start.music_s(now), None);
        let other = start.clone();
        other.set(now + Duration::from_secs(4));
        let at = |seconds: f64| start.music_s(now + Duration::from_secs_f64(seconds));
        assert!((at(1.0).unwrap() + 3.0).abs() < 1e-6);
        assert!((at(5.5).unwrap() - 1.5).abs() < 1e-6);
        other.silence();
        assert_eq!(at(6.0), None);
    }
}
