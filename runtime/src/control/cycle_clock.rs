//! When the control cycles are: an even grid from a start, followed by the wall
//! clock or, with `--speed max`, in simulated time.
//!
//! After a stall of the machine the robot does not rush: it goes on from where
//! it was and makes up the lost time a little in each cycle.

use crate::process::speed::Speed;
use std::time::{Duration, Instant};

/// A cycle that is later than this many periods moves those behind it, so that no two are
/// close together.
const LATE_PERIODS: f64 = 0.05;
/// Share of a period by which cycles come sooner until a stall is made up.
const CATCH_UP: f64 = 0.03;

#[derive(Clone, Debug)]
pub struct CycleClock {
    speed: Speed,
    period_s: f64,
    started: Instant,
    cycle: u64,
    /// By how much the cycles are behind their grid.
    slip_s: f64,
}

impl CycleClock {
    /// A clock that starts now, with cycle 0.
    pub fn new(speed: Speed, period_s: f64) -> Self {
        Self { speed, period_s, started: Instant::now(), cycle: 0, slip_s: 0.0 }
    }

    pub fn start_at(&mut self, moment: Instant) {
        self.started = moment;
    }

    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// Seconds from the first cycle to the present one, by the grid.
    pub fn cycle_s(&self) -> f64 {
        self.cycle as f64 * self.period_s
    }

    pub fn advance(&mut self) {
        self.cycle += 1;
    }

    /// Seconds since the start, by the wall clock.
    pub fn elapsed_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// When something is, by the wall clock, that the grid has at `grid_s`.
    pub fn moment(&self, grid_s: f64) -> Instant {
        self.started + Duration::from_secs_f64(grid_s + self.slip_s)
    }

    /// Waits for the moment of the present cycle; by how many seconds it was
    /// missed. `None`, at once, in simulated time.
    pub fn wait(&mut self) -> Option<f64> {
        if self.speed == Speed::Max {
            return None;
        }
        let due_s = self.cycle_s() + self.slip_s;
        let now_s = self.elapsed_s();
        let rest_s = (self.place(now_s) - now_s).max(0.0);
        std::thread::sleep(Duration::from_secs_f64(rest_s));
        let began_s = self.elapsed_s();
        self.note_start(began_s);
        Some(began_s - due_s)
    }

    /// When the present cycle is to be, seconds after the start; it is `now_s`.
    fn place(&mut self, now_s: f64) -> f64 {
        self.slip_s = (self.slip_s - CATCH_UP * self.period_s).max(0.0);
        self.note_start(now_s);
        self.cycle_s() + self.slip_s
    }

    /// The present cycle begins at `now_s` at the earliest.
    fn note_start(&mut self, now_s: f64) {
        let late_s = now_s - self.cycle_s() - self.slip_s;
        if late_s > LATE_PERIODS * self.period_s {
            self.slip_s += late_s;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simulated_time_waits_for_nothing() {
        let mut clock = CycleClock::new(Speed::Max, 1000.0);
        clock.advance();
        assert_eq!((clock.wait(), clock.cycle_s()), (None, 1000.0));
    }

    #[test]
    fn a_stall_is_made_up_a_little_in_each_cycle() {
        let mut clock = CycleClock::new(Speed::Realtime, 0.01);
        assert_eq!(clock.place(0.0004), 0.0); // a little late
        assert_eq!(clock.place(0.03), 0.03);
        let mut last_s = 0.03;
        for _ in 0..150 {
            clock.advance();
            let placed_s = clock.place(last_s);
            let apart_s = placed_s - last_s;
            assert!((0.0096..0.0101).contains(&apart_s), "{apart_s}");
            last_s = placed_s;
        }
        assert_eq!(last_s, clock.cycle_s()); // back on the grid
    }
}
