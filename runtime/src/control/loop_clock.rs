//! The clocks of a run: cycles, music, recording, robot. Seconds.
//!
//! ```text
//! torque on      first cycle             music begins
//!     |-- stood_s --|---- music_start_s ----|----- time_s ---->
//!     |             |-------- cycle_s, recording time -------->
//!     |---------------------- robot time --------------------->
//! ```

use super::cycle_clock::CycleClock;
use std::time::Instant;

pub struct LoopClock {
    pub cycles: CycleClock,
    /// From the first cycle to the music; below zero if live music came before.
    pub music_start_s: f64,
    /// From torque on to the first cycle of the dance.
    pub stood_s: f64,
}

impl LoopClock {
    /// Music time of the present cycle; below zero in the lead-in.
    pub fn time_s(&self) -> f64 {
        self.cycles.cycle_s() - self.music_start_s
    }

    pub fn recording_s(&self, time_s: f64) -> f64 {
        time_s + self.music_start_s
    }

    pub fn robot_s(&self, time_s: f64) -> f64 {
        self.stood_s + time_s + self.music_start_s
    }

    pub fn start_now(&mut self) {
        self.cycles.start_at(Instant::now());
    }
}
