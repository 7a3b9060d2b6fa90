//! When goals go out, to whom, and how often each is said.
//!
//! Goals are spaced: each is a step of one control period, and goals that would come too soon
//! after the last ones **had left** wait, however long this thread was kept from sending those.
//! For the same reason nobody is asked again late in a period. While the wire loses
//! packets goals are said several times: a servo that misses one stops for a period.
//!
//! A servo that took the id of another is silent under its own, and the answers of the two
//! collide. Goals go to everyone while at most one does not answer soundly. Else those who do
//! not answer get none, unless nothing came damaged and they answered in the cycle before.

use std::time::{Duration, Instant};

use crate::bus::config::BusConfig;
use crate::bus::reply_clock::ReplyClock;

/// Goals are at least this share of a control period apart.
const SPACING: f64 = 0.96;
/// After this share of a period nobody is asked again.
const LATE: f64 = 0.6;
/// How often a goal is said while the wire loses packets, in at most this share of a period,
/// and for how many cycles after a loss.
const COPIES: f64 = 4.0;
const COPIED: f64 = 0.3;
const ROUGH_CYCLES: u32 = 1000;

/// When goals went out, and to whom.
#[derive(Debug)]
pub(super) struct GoalTiming {
    began: Instant,
    last: Option<Instant>,
    sent: Vec<bool>,
    /// For so many cycles more the wire is taken to lose packets.
    rough: u32,
}

impl GoalTiming {
    pub fn new(servos: usize) -> Self {
        Self { began: Instant::now(), last: None, sent: vec![false; servos], rough: 0 }
    }

    pub fn begin_cycle(&mut self) {
        self.began = Instant::now();
        self.sent.fill(false);
    }

    /// Whether the wire lost or damaged anything in this cycle.
    pub fn note_wire(&mut self, lost: bool) {
        self.rough = if lost { ROUGH_CYCLES } else { self.rough.saturating_sub(1) };
    }

    /// How often goals that take so long on the wire are said.
    pub fn copies(&self, config: &BusConfig, once: Duration) -> usize {
        let share = share_of_period(config, COPIED);
        let room = share.map_or(COPIES, |share| share.as_secs_f64() / once.as_secs_f64());
        if self.rough > 0 { room.clamp(1.0, COPIES) as usize } else { 1 }
    }

    /// Waits until goals may go out, and decides to whom: `missing` says for how many cycles
    /// each servo has not answered, `None` of one that is left out.
    pub fn begin_sending<M>(&mut self, config: &BusConfig, missing: M, damaged: bool)
    where
        M: Iterator<Item = Option<u32>> + Clone,
    {
        std::thread::sleep(self.too_soon_by(config));
        let alone = missing.clone().flatten().filter(|cycles| *cycles > 0).count() <= 1;
        let longest = if damaged { 0 } else { 1 };
        for (sent, missing) in self.sent.iter_mut().zip(missing) {
            *sent = missing.is_some_and(|cycles| alone || cycles <= longest);
        }
    }

    /// The goals have been handed to the port.
    pub fn end_sending(&mut self) {
        self.last = Some(Instant::now());
    }

    pub fn was_sent(&self, index: usize) -> bool {
        self.sent.get(index) == Some(&true)
    }

    /// Whether cycles have a period that time on the wall decides about.
    pub fn is_timed(&self, config: &BusConfig) -> bool {
        share_of_period(config, 1.0).is_some()
    }

    /// Whether so much of the period has passed that another question would delay the goals.
    pub fn is_late(&self, config: &BusConfig) -> bool {
        share_of_period(config, LATE).is_some_and(|late| self.began.elapsed() > late)
    }

    fn too_soon_by(&self, config: &BusConfig) -> Duration {
        let spacing = share_of_period(config, SPACING).unwrap_or_default();
        let passed = self.last.map_or(spacing, |last| last.elapsed());
        spacing.saturating_sub(passed)
    }
}

/// So much of a control period; `None` in simulated time, and where nobody asks for a rate.
fn share_of_period(config: &BusConfig, share: f64) -> Option<Duration> {
    let hz = config.control_hz.filter(|_| config.reply_clock == ReplyClock::Wall)?;
    Some(Duration::from_secs_f64(share / hz))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn goals_are_spaced_by_the_clock_on_the_wall_alone() {
        let now = Instant::now();
        let timing = GoalTiming { began: now, last: Some(now), sent: vec![true, false], rough: 0 };
        let config = |hz| BusConfig { control_hz: hz, ..BusConfig::dynamixel2(1_000_000) };
        assert!(timing.too_soon_by(&config(Some(0.01))) > Duration::from_secs(50));
        assert_eq!(timing.too_soon_by(&config(None)), Duration::ZERO);
        assert!(!timing.is_late(&config(Some(0.01))));
        std::thread::sleep(Duration::from_millis(2));
        assert!(timing.is_late(&config(Some(1000.0))));
        assert_eq!(timing.too_soon_by(&config(Some(1000.0))), Duration::ZERO);
        assert_eq!([0, 1, 2].map(|index| timing.was_sent(index)), [true, false, false]);
    }
    #[test]
    fn one_who_is_silent_gets_a_goal_and_two_do_not_if_anything_is_odd() {
        let config = BusConfig::dynamixel2(1_000_000);
        let mut timing = GoalTiming::new(4);
        let mut sent = |missing: [u32; 3], damaged| {
            let missing = missing.into_iter().map(Some).chain([None]);
            timing.begin_sending(&config, missing, damaged);
            [0, 1, 2, 3].map(|index| timing.was_sent(index))
        };
        assert_eq!(sent([0, 9, 0], true), [true, true, true, false]);
        assert_eq!(sent([0, 1, 1], true), [true, false, false, false]);
        assert_eq!(sent([0, 1, 1], false), [true, true, true, false]);
        assert_eq!(sent([0, 1, 2], false), [true, true, false, false]);
    }

    #[test]
    fn goals_are_said_several_times_after_a_loss_where_there_is_time() {
        let config = BusConfig { control_hz: Some(100.0), ..BusConfig::dynamixel2(1_000_000) };
        let mut timing = GoalTiming::new(1);
        let copies = |timing: &GoalTiming, ms| timing.copies(&config, Duration::from_millis(ms));
        assert_eq!(copies(&timing, 1), 1);
        timing.note_wire(true);
        assert_eq!([0, 1, 2].map(|ms| copies(&timing, ms)), [4, 3, 1]);
        (0..ROUGH_CYCLES).for_each(|_| timing.note_wire(false));
        assert_eq!(copies(&timing, 1), 1);
    }
}
