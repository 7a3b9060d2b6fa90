//! Where the servos truly were, and when by the machine's clock, which all
//! programs of the machine share: for setting robots side by side.
//!
//! Kept in memory of a size that is known beforehand; what comes when it is full
//! is left out. Written as lines of text: seconds, share of idle, positions.

use std::fmt::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

/// Positions of every cycle of one run.
#[derive(Debug)]
pub struct Witness {
    zero: Instant,
    /// Seconds of the shared clock at `zero`.
    zero_s: f64,
    joints: usize,
    room: usize,
    seen: Vec<(Duration, f32, Vec<f32>)>,
}

impl Witness {
    /// One for so many joints and cycles. `shared_s` reads the shared clock.
    pub fn new(joints: usize, cycles: usize, shared_s: impl Fn() -> f64) -> Self {
        Self {
            zero: Instant::now(),
            zero_s: shared_s(),
            joints,
            room: cycles,
            seen: Vec::with_capacity(cycles),
        }
    }

    /// Looks at the servos now; `idle`: the share of idle in what is decided.
    pub(crate) fn see(&mut self, idle: f64, positions_rad: impl Iterator<Item = f64>) {
        if self.seen.len() < self.room {
            let mut positions = Vec::with_capacity(self.joints);
            positions.extend(positions_rad.map(|p| p as f32));
            self.seen
                .push((self.zero.elapsed(), idle as f32, positions));
        }
    }

    /// Writes all that was seen.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        let mut text = String::new();
        for (at, idle, positions) in &self.seen {
            let _ = write!(text, "{:.6} {idle:.3}", self.zero_s + at.as_secs_f64());
            for position in positions {
                let _ = write!(text, " {position:.5}");
            }
            text.push('\n');
        }
        crate::telemetry::pending_file::write_whole(path, text.as_bytes())
    }
}
