//! Where the servos truly were, and when by the machine's clock, which all
//! programs of the machine share: for setting robots side by side.
//!
//! Kept in memory of fixed size; cycles after it is full are left out. Written as lines of text: seconds, share of idle, positions.

use std::fmt::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

#[derive(Debug)]
pub struct ServoTruthLog {
    zero: Instant,
    /// Seconds of the shared clock at `zero`.
    zero_s: f64,
    joints: usize,
    room: usize,
    /// Time since `zero`, share of idle, positions in radians.
    cycles: Vec<(Duration, f32, Vec<f32>)>,
}

impl ServoTruthLog {
    /// Room for so many joints and cycles. `shared_s` reads the shared clock.
    pub fn new(joints: usize, cycles: usize, shared_s: impl Fn() -> f64) -> Self {
        Self {
            zero: Instant::now(),
            zero_s: shared_s(),
            joints,
            room: cycles,
            cycles: Vec::with_capacity(cycles),
        }
    }

    /// The servos as they are now; `idle`: share of idle in the command.
    pub fn push(&mut self, idle: f64, positions_rad: impl Iterator<Item = f64>) {
        if self.cycles.len() < self.room {
            let mut positions = Vec::with_capacity(self.joints);
            positions.extend(positions_rad.map(|p| p as f32));
            self.cycles.push((self.zero.elapsed(), idle as f32, positions));
        }
    }

    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        let mut text = String::new();
        for (at, idle, positions) in &self.cycles {
            let _ = write!(text, "{:.6} {idle:.3}", self.zero_s + at.as_secs_f64());
            for position in positions {
                let _ = write!(text, " {position:.5}");
            }
            text.push('\n');
        }
        crate::telemetry::pending_file::write_whole(path, text.as_bytes())
    }
}
