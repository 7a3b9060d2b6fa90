//! How far apart the control cycles really are, by the clock on the wall, and a word when
//! the machine or the bus does not keep up.
//!
//! The cycle clock places cycles on a grid and slips when it must; what the servos feel
//! is the time from one command to the next.

use crate::pipeline::step_times::{DurationLog, StepTimes};
use std::time::Instant;

/// No command for so long is told, seconds.
const LONG_S: f64 = 0.1;
/// The rate is looked at this often, seconds.
const WINDOW_S: f64 = 1.0;
/// Below this share of the wanted rate it is slow; from the second on it is well again.
const SLOW: f64 = 0.9;
const WELL: f64 = 0.97;
/// Gaps are uneven when one in a hundred takes so many periods; even when it takes so many for
/// that many windows.
const UNEVEN: f64 = 1.5;
const EVEN: f64 = 1.2;
const EVEN_WINDOWS: u32 = 10;
/// More gaps of one window are not kept.
const KEPT: usize = 2048;

#[derive(Debug)]
pub struct CycleGaps {
    period_s: f64,
    last: Option<Instant>,
    gaps_ms: DurationLog,
    /// When the window of the rate began, and its cycles.
    window: (Instant, u32),
    is_slow: bool,
    window_ms: Vec<f64>,
    /// Percentiles of the last whole window.
    recent: StepTimes,
    /// The 99th percentile that was told last, milliseconds; 0 while gaps are even.
    told_ms: f64,
    even_windows: u32,
}

impl CycleGaps {
    /// No cycle yet; one each `period_s` is wanted.
    pub fn new(period_s: f64) -> Self {
        Self {
            period_s,
            last: None,
            gaps_ms: DurationLog::default(),
            window: (Instant::now(), 0),
            is_slow: false,
            window_ms: Vec::with_capacity(KEPT),
            recent: StepTimes::default(),
            told_ms: 0.0,
            even_windows: 0,
        }
    }

    /// A cycle begins now. What the user should know.
    pub fn cycle(&mut self, now: Instant) -> Option<String> {
        let Some(last) = self.last.replace(now) else {
            self.window = (now, 0);
            return None;
        };
        let gap_s = now.duration_since(last).as_secs_f64();
        self.gaps_ms.push(gap_s * 1e3);
        if self.window_ms.len() < KEPT {
            self.window_ms.push(gap_s * 1e3);
        }
        if gap_s > LONG_S.max(3.0 * self.period_s) {
            self.window = (now, 0);
            return Some(format!("no command was sent for {gap_s:.2} s: the machine was busy"));
        }
        self.watch_rate(now)
    }

    fn watch_rate(&mut self, now: Instant) -> Option<String> {
        let (began, cycles) = &mut self.window;
        *cycles += 1;
        let elapsed_s = now.duration_since(*began).as_secs_f64();
        if elapsed_s < WINDOW_S {
            return None;
        }
        let rate_hz = f64::from(*cycles) / elapsed_s;
        let share = rate_hz * self.period_s;
        self.window = (now, 0);
        self.recent = StepTimes::sorting(&mut self.window_ms);
        self.window_ms.clear();
        let was_slow = self.is_slow;
        self.is_slow = share < if was_slow { WELL } else { SLOW };
        let wanted_hz = 1.0 / self.period_s;
        match (was_slow, self.is_slow) {
            (false, true) => Some(format!(
                "only {rate_hz:.0} of {wanted_hz:.0} cycles a second: replies come late, or the machine is busy"
            )),
            (true, false) => Some(format!("{wanted_hz:.0} cycles a second again")),
            (true, true) => None,
            (false, false) => self.watch_evenness(),
        }
    }

    fn watch_evenness(&mut self) -> Option<String> {
        let (p99_ms, period_ms) = (self.recent.p99_ms, self.period_s * 1e3);
        let is_even = p99_ms < EVEN * period_ms;
        self.even_windows = if is_even { self.even_windows + 1 } else { 0 };
        if p99_ms > (UNEVEN * period_ms).max(2.0 * self.told_ms) {
            self.told_ms = p99_ms;
            return Some(format!(
                "commands come unevenly: {p99_ms:.1} ms apart where {period_ms:.1} are wanted, the \
                 longest {:.1} ms: replies come late, or the machine is busy",
                self.recent.max_ms
            ));
        }
        if self.told_ms > 0.0 && self.even_windows >= EVEN_WINDOWS {
            self.told_ms = 0.0;
            return Some("commands come evenly again".into());
        }
        None
    }

    /// Percentiles of the time from command to command in the last second, milliseconds.
    pub fn recent(&self) -> StepTimes {
        self.recent
    }

    /// Percentiles of the time from command to command, milliseconds.
    pub fn percentiles(&self) -> StepTimes {
        self.gaps_ms.percentiles()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    /// What is said when cycles come at these times, milliseconds.
    fn said(times_ms: impl Iterator<Item = u64>) -> (Vec<String>, StepTimes) {
        let mut gaps = CycleGaps::new(0.01);
        let began = Instant::now();
        let said = times_ms.filter_map(|at_ms| gaps.cycle(began + Duration::from_millis(at_ms)));
        (said.collect(), gaps.percentiles())
    }

    #[test]
    fn a_gap_is_told_and_measured() {
        let (said, gaps) = said((0..300).map(|k| k * 10 + if k > 100 { 500 } else { 0 }));
        assert_eq!(said, ["no command was sent for 0.51 s: the machine was busy"]);
        assert_eq!((gaps.p50_ms, gaps.p99_ms, gaps.max_ms), (10.0, 10.0, 510.0));
    }

    #[test]
    fn uneven_commands_are_told_once_and_when_they_are_even_again() {
        let uneven = (0..200).map(|k| k * 10 + if k % 10 == 0 { 8 } else { 0 });
        let (said, _) = said(uneven.chain((200..1600).map(|k| k * 10)));
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(said[0].starts_with("commands come unevenly: 18.0 ms apart"), "{said:?}");
        assert_eq!(said[1], "commands come evenly again");
    }

    #[test]
    fn a_slow_bus_is_told_once_and_when_it_is_well_again() {
        let slow = (0..100).map(|k| k * 30);
        let (said, _) = said(slow.chain((0..300).map(|k| 3000 + k * 10)));
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(said[0].starts_with("only 33 of 100 cycles"), "{said:?}");
        assert_eq!(said[1], "100 cycles a second again");
    }
}
