//! What the wire did of late: how many answers were lost or damaged, and whether anybody
//! answered at all.

use crate::bus::BusStats;
use crate::bus::error_counters::{ErrorCounters, ServoErrors};

/// The share of cycles with an error is looked at this often, seconds.
const WINDOW_S: f64 = 1.0;
/// Told from this share on, again when it has doubled, and below half of it as over.
const ROUGH: f64 = 0.02;

/// What the wire did in the last window.
#[derive(Debug, Default)]
pub(super) struct RoughWire {
    began_s: f64,
    before: BusStats,
    servos_before: Vec<ServoErrors>,
    /// The share that was told last; 0 while the wire is sound.
    told: f64,
}

impl RoughWire {
    pub fn is_due(&self, now_s: f64) -> bool {
        now_s - self.began_s >= WINDOW_S || now_s < self.began_s
    }

    /// What is to be told of the window that ends now, with the servo to blame by its
    /// place if there is one.
    pub fn look(
        &mut self,
        now_s: f64,
        stats: BusStats,
        servos: &ErrorCounters,
    ) -> Option<Roughness> {
        self.began_s = now_s;
        let cycles = stats.cycles.saturating_sub(self.before.cycles);
        let wrong = stats.errors().saturating_sub(self.before.errors());
        self.before = stats;
        if cycles == 0 {
            return None;
        }
        let share = wrong as f64 / cycles as f64;
        if self.told == 0.0 && share < ROUGH {
            return None;
        }
        let worst = self.worst_servo(servos.read());
        if share > ROUGH.max(2.0 * self.told) {
            self.told = share;
            return Some(Roughness { share, worst });
        }
        if self.told > 0.0 && share < 0.5 * ROUGH {
            self.told = 0.0;
            return Some(Roughness { share: 0.0, worst: None });
        }
        None
    }

    /// Who has had most of the errors since this was asked last, if that is most of all.
    fn worst_servo(&mut self, now: Vec<ServoErrors>) -> Option<usize> {
        let before = |index: usize| self.servos_before.get(index).map_or(0, ServoErrors::lost);
        let new: Vec<u64> =
            now.iter().enumerate().map(|(i, e)| e.lost().saturating_sub(before(i))).collect();
        let (worst, most) = new.iter().copied().enumerate().max_by_key(|(_, errors)| *errors)?;
        let all: u64 = new.iter().sum();
        self.servos_before = now;
        (all > 0 && 2 * most > all).then_some(worst)
    }
}

/// The share of cycles with an error, and the place of the servo that has most of them.
pub(super) struct Roughness {
    pub share: f64,
    pub worst: Option<usize>,
}

/// A delay of this share of a cycle is told, again when it has doubled, and below half of it
/// as over.
const LATE: f64 = 0.5;

/// What adapter and system add to the time of answers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LinkDelay {
    began: (f64, u64),
    /// The delay that was told last, seconds; 0 while answers are prompt.
    told_s: f64,
}

impl LinkDelay {
    /// At the end of a window: delay and period, seconds, if they are to be told; a delay of 0
    /// that it is over.
    pub fn look(&mut self, now_s: f64, stats: BusStats) -> Option<(f64, f64)> {
        let (began_s, cycles) = std::mem::replace(&mut self.began, (now_s, stats.cycles));
        let cycles = stats.cycles.saturating_sub(cycles);
        if cycles == 0 || now_s <= began_s {
            return None;
        }
        let period_s = (now_s - began_s) / cycles as f64;
        let delay_s = stats.delay_us as f64 * 1e-6;
        if delay_s > (LATE * period_s).max(2.0 * self.told_s) {
            self.told_s = delay_s;
            return Some((delay_s, period_s));
        }
        if self.told_s > 0.0 && delay_s < 0.5 * LATE * period_s {
            self.told_s = 0.0;
            return Some((0.0, period_s));
        }
        None
    }
}

/// Cycles in which no servo answered, so that no goal was sent.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Unheard {
    total: u64,
    in_a_row: u32,
}

/// After so many of them in a row the motion is blended in again.
const DEAF_CYCLES: u32 = 3;

impl Unheard {
    /// One more cycle; for how many nobody answered, if those were many and are over now.
    pub fn look(&mut self, total: u64) -> Option<u32> {
        if total > self.total {
            (self.total, self.in_a_row) = (total, self.in_a_row + 1);
            return None;
        }
        let cycles = std::mem::take(&mut self.in_a_row);
        (cycles >= DEAF_CYCLES).then_some(cycles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_motion_is_blended_in_again_after_many_cycles_without_an_answer() {
        let mut unheard = Unheard::default();
        let mut look = |total| unheard.look(total);
        assert_eq!([look(0), look(1), look(1)], [None; 3]);
        assert_eq!([look(2), look(3), look(4)], [None; 3]);
        assert_eq!([look(4), look(4)], [Some(3), None]);
    }

    #[test]
    fn a_slow_link_is_told_when_it_begins_grows_and_ends() {
        let mut link = LinkDelay::default();
        let mut cycles = 0;
        let mut second = |delay_us| {
            cycles += 100;
            link.look(cycles as f64 * 0.01, BusStats { cycles, delay_us, ..BusStats::default() })
                .map(|(delay_s, _)| delay_s)
        };
        assert_eq!([second(0), second(4_900)], [None; 2]);
        assert_eq!([second(6_000), second(11_000)], [Some(0.006), None]);
        assert_eq!([second(13_000), second(3_000), second(2_000)], [Some(0.013), None, Some(0.0)]);
        assert_eq!(second(2_000), None);
    }

    #[test]
    fn a_rough_wire_is_told_when_it_begins_grows_and_ends() {
        let mut wire = RoughWire::default();
        let counters = ErrorCounters::new(2);
        let mut stats = BusStats::default();
        let mut second = |wire: &mut RoughWire, errors: u64| {
            stats.cycles += 100;
            stats.timeouts += errors;
            (0..errors).for_each(|_| counters.timed_out(1));
            let now_s = stats.cycles as f64 * 0.01;
            wire.look(now_s, stats, &counters).map(|rough| (rough.share, rough.worst))
        };
        assert_eq!(second(&mut wire, 0), None);
        assert_eq!(second(&mut wire, 1), None, "one is no reason");
        assert_eq!(second(&mut wire, 4), Some((0.04, Some(1))));
        assert_eq!(second(&mut wire, 5), None, "it was told");
        assert_eq!(second(&mut wire, 20), Some((0.2, Some(1))));
        assert_eq!(second(&mut wire, 0), Some((0.0, None)));
        assert_eq!(second(&mut wire, 0), None);
    }
}
