//! The leader's clock, as a follower knows it from questions and answers.
//!
//! ```text
//! follower   asked ----------.             .-----------> back
//!                             \           /
//! leader                     heard -> answered
//! ```
//!
//! Offset and way of one exchange are those of NTP (RFC 5905, section 8):
//! offset = ((heard - asked) + (answered - back)) / 2, delay = (back - asked) -
//! (answered - heard). The offset is wrong by half of what the way there is
//! longer than the way back, so an exchange counts the less the more its delay is
//! above the shortest of late: weight = 1 / (FINEST_S + delay - shortest)^2.
//! Offset and drift are the weighted least-squares line through the exchanges of
//! [`WINDOW_S`]; the drift is held back by what quartz clocks can be
//! ([`DRIFT`], ridge regression), so that a young estimate does not swing.
//!
//! What no exchange can show: a network that is always slower one way. The
//! error is at most half of the shortest delay ([`Estimate::bound_s`]).

use std::collections::VecDeque;

/// Exchanges older than this are forgotten, seconds.
const WINDOW_S: f64 = 30.0;
/// Exchanges kept at most.
const KEPT: usize = 160;
/// Fewer exchanges than this tell nothing.
const FEWEST: usize = 4;
/// Differences of delay below this say little, seconds.
const FINEST_S: f64 = 2e-4;
/// Clocks usually drift less than this, seconds a second.
const DRIFT: f64 = 5e-5;
/// An exchange that took longer is no use, seconds.
const LONGEST_S: f64 = 3.0;

/// One exchange.
#[derive(Clone, Copy, Debug)]
struct Exchange {
    /// Middle of it, nanoseconds of the follower's clock.
    at_ns: i64,
    offset_ns: i64,
    delay_s: f64,
}

/// What is known of the leader's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The moment for which `offset_ns` holds, nanoseconds of the follower's clock.
    pub at_ns: i64,
    /// Leader's clock less follower's clock at that moment, nanoseconds.
    pub offset_ns: f64,
    /// By how much the leader's clock is faster, seconds a second.
    pub drift: f64,
    /// Shortest way there and back of late, seconds.
    pub delay_s: f64,
}

impl Estimate {
    /// The leader's clock at a moment of the follower's, nanoseconds.
    pub fn leader_ns(&self, now_ns: i64) -> i64 {
        let since_ns = now_ns.saturating_sub(self.at_ns) as f64;
        now_ns.saturating_add((self.offset_ns + self.drift * since_ns) as i64)
    }

    /// The largest error that an unequal network can hide, seconds.
    pub fn bound_s(&self) -> f64 {
        self.delay_s / 2.0
    }
}

/// Estimates the leader's clock.
#[derive(Clone, Debug, Default)]
pub struct StageClock {
    exchanges: VecDeque<Exchange>,
    estimate: Option<Estimate>,
}

impl StageClock {
    /// Takes in an exchange; nanoseconds of the follower's clock for `asked`
    /// and `back`, of the leader's for the others. One that cannot be is left out.
    pub fn push(&mut self, asked_ns: i64, heard_ns: i64, answered_ns: i64, back_ns: i64) {
        let [asked, heard, answered, back] =
            [asked_ns, heard_ns, answered_ns, back_ns].map(i128::from);
        let delay_s = ((back - asked) - (answered - heard)) as f64 * 1e-9;
        let offset = ((heard - asked) + (answered - back)) / 2;
        let offset_ns = i64::try_from(offset);
        let (Ok(offset_ns), true) = (offset_ns, (0.0..LONGEST_S).contains(&delay_s)) else {
            return;
        };
        let at_ns = asked_ns.midpoint(back_ns);
        let old = |e: &Exchange| (at_ns - e.at_ns) as f64 * 1e-9 > WINDOW_S;
        while self.exchanges.len() >= KEPT || self.exchanges.front().is_some_and(old) {
            self.exchanges.pop_front();
        }
        self.exchanges.push_back(Exchange {
            at_ns,
            offset_ns,
            delay_s,
        });
        self.estimate = (self.exchanges.len() >= FEWEST).then(|| self.fit());
    }

    /// What is known now; `None` while it is too little.
    pub fn estimate(&self) -> Option<Estimate> {
        self.estimate
    }

    /// Exchanges that count.
    pub fn exchanges(&self) -> usize {
        self.exchanges.len()
    }

    fn fit(&self) -> Estimate {
        let newest = self.exchanges[self.exchanges.len() - 1];
        let delays = self.exchanges.iter().map(|e| e.delay_s);
        let shortest_s = delays.fold(f64::INFINITY, f64::min);
        // Relative to the newest, so that nothing is lost to rounding.
        let weighed = || {
            self.exchanges.iter().map(|e| {
                let weight = (FINEST_S + e.delay_s - shortest_s).powi(-2);
                let time_s = (e.at_ns - newest.at_ns) as f64 * 1e-9;
                let offset_s = e.offset_ns.saturating_sub(newest.offset_ns) as f64 * 1e-9;
                (weight, time_s, offset_s)
            })
        };
        let sum = |value: fn((f64, f64, f64)) -> f64| weighed().map(value).sum::<f64>();
        let weights = sum(|(w, _, _)| w);
        let mean_time_s = sum(|(w, t, _)| w * t) / weights;
        let mean_offset_s = sum(|(w, _, o)| w * o) / weights;
        let (mut covariance, mut variance) = (0.0, DRIFT.powi(-2));
        for (weight, time_s, offset_s) in weighed() {
            covariance += weight * (time_s - mean_time_s) * (offset_s - mean_offset_s);
            variance += weight * (time_s - mean_time_s).powi(2);
        }
        let drift = covariance / variance;
        Estimate {
            at_ns: newest.at_ns,
            offset_ns: newest.offset_ns as f64 + (mean_offset_s - drift * mean_time_s) * 1e9,
            drift,
            delay_s: shortest_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Asks every 250 ms for `seconds` over a network with this delay each way,
    /// jitter on top, and loss; gives the errors in seconds at the end and 2 s on.
    fn errors_s(delay_s: f64, jitter_s: f64, loss: f64, drift: f64, seconds: f64) -> [f64; 2] {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let truth = |t: f64| 1234.5 + t * (1.0 + drift);
        let ns = |s: f64| (s * 1e9) as i64;
        let mut clock = StageClock::default();
        let mut now_s = 0.0;
        while now_s < seconds {
            let mut way = || delay_s + jitter_s * rng.random::<f64>().powi(2);
            let (there, back) = (way(), way());
            if rng.random::<f64>() >= loss {
                let heard = truth(now_s + there);
                let answered = truth(now_s + there + 1e-4);
                let home = now_s + there + 1e-4 + back;
                clock.push(ns(now_s), ns(heard), ns(answered), ns(home));
            }
            now_s += 0.25;
        }
        let estimate = clock.estimate().expect("enough exchanges");
        [now_s, now_s + 2.0].map(|t| (estimate.leader_ns(ns(t)) - ns(truth(t))) as f64 * 1e-9)
    }

    #[test]
    fn offset_and_drift_are_found_through_jitter_and_loss() {
        for (delay_s, jitter_s, drift, seconds, most_s) in [
            (0.001, 0.0, 0.0, 1.5, 1e-6),
            (0.001, 0.002, 2e-5, 30.0, 3e-4),
            (0.05, 0.02, 1e-4, 30.0, 1.5e-3),
            (0.05, 0.02, -1e-4, 120.0, 1.5e-3),
            (0.02, 0.1, 5e-5, 60.0, 4e-3),
        ] {
            for error_s in errors_s(delay_s, jitter_s, 0.05, drift, seconds) {
                assert!(
                    error_s.abs() < most_s,
                    "{delay_s} {jitter_s} {drift}: {error_s}"
                );
            }
        }
    }

    #[test]
    fn exchanges_that_cannot_be_are_left_out() {
        let mut clock = StageClock::default();
        for _ in 0..10 {
            clock.push(100, 0, 500, 200); // answered after it came back
            clock.push(0, i64::MAX, i64::MIN, 10);
            clock.push(0, 5, 6, 4_000_000_000); // took too long
        }
        assert_eq!((clock.exchanges(), clock.estimate()), (0, None));
    }
}
