//! Estimates the leader's clock from requests and replies.
//!
//! ```text
//! follower   asked ------------.             .-----------> back
//!                               \           /
//! leader                     received -> replied
//! ```
//!
//! Offset and delay of one exchange are those of NTP (RFC 5905, section 8):
//! offset = ((received - asked) + (replied - back)) / 2, delay = (back - asked) -
//! (replied - received). The error of the offset is half of the difference of the
//! two ways, so an exchange counts less the more its delay exceeds the shortest of
//! the window: weight = 1 / (FINEST_S + delay - shortest)^2. Offset and drift are
//! the weighted least-squares line through the exchanges of [`WINDOW_S`]; ridge
//! regression with the usual drift of quartz clocks ([`DRIFT`]) steadies an
//! estimate from few exchanges.
//!
//! No exchange shows a network that is always slower one way. The error is at most
//! half of the shortest delay ([`ClockEstimate::bound_s`]).

use std::collections::VecDeque;

/// Exchanges older than this are forgotten, seconds.
const WINDOW_S: f64 = 30.0;
/// Largest number of exchanges.
const KEPT: usize = 160;
/// Exchanges that an estimate needs.
const FEWEST: usize = 4;
/// Differences of delay below this do not count, seconds.
const FINEST_S: f64 = 2e-4;
/// Clocks usually drift less than this, seconds a second.
const DRIFT: f64 = 5e-5;
/// An exchange that took longer is dropped, seconds.
const LONGEST_S: f64 = 3.0;

#[derive(Clone, Copy, Debug)]
struct TimeExchange {
    /// Middle of the exchange, nanoseconds of the follower's clock.
    at_ns: i64,
    offset_ns: i64,
    delay_s: f64,
}

/// An estimate of the leader's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockEstimate {
    /// Time at which `offset_ns` holds, nanoseconds of the follower's clock.
    pub at_ns: i64,
    /// Leader's clock less follower's clock at that time, nanoseconds.
    pub offset_ns: f64,
    /// Drift of the leader's clock against the follower's, seconds a second.
    pub drift: f64,
    /// Shortest round trip of the window, seconds.
    pub delay_s: f64,
}

impl ClockEstimate {
    /// The leader's clock at a time of the follower's, nanoseconds.
    pub fn leader_ns(&self, now_ns: i64) -> i64 {
        let since_ns = now_ns.saturating_sub(self.at_ns) as f64;
        now_ns.saturating_add((self.offset_ns + self.drift * since_ns) as i64)
    }

    /// The largest error that an asymmetric network can cause, seconds.
    pub fn bound_s(&self) -> f64 {
        self.delay_s / 2.0
    }
}

/// Estimates the leader's clock from time exchanges.
#[derive(Clone, Debug, Default)]
pub struct LeaderClock {
    exchanges: VecDeque<TimeExchange>,
    estimate: Option<ClockEstimate>,
}

impl LeaderClock {
    /// Takes an exchange; nanoseconds of the follower's clock for `asked` and
    /// `back`, of the leader's for the others. An impossible one is dropped.
    pub fn push(&mut self, asked_ns: i64, received_ns: i64, replied_ns: i64, back_ns: i64) {
        let [asked, received, replied, back] =
            [asked_ns, received_ns, replied_ns, back_ns].map(i128::from);
        let delay_s = ((back - asked) - (replied - received)) as f64 * 1e-9;
        let offset = ((received - asked) + (replied - back)) / 2;
        let offset_ns = i64::try_from(offset);
        let (Ok(offset_ns), true) = (offset_ns, (0.0..LONGEST_S).contains(&delay_s)) else {
            return;
        };
        let at_ns = asked_ns.midpoint(back_ns);
        let old = |e: &TimeExchange| (at_ns - e.at_ns) as f64 * 1e-9 > WINDOW_S;
        while self.exchanges.len() >= KEPT || self.exchanges.front().is_some_and(old) {
            self.exchanges.pop_front();
        }
        self.exchanges.push_back(TimeExchange { at_ns, offset_ns, delay_s });
        self.estimate = (self.exchanges.len() >= FEWEST).then(|| self.fit());
    }

    /// The present estimate; `None` with too few exchanges.
    pub fn estimate(&self) -> Option<ClockEstimate> {
        self.estimate
    }

    /// Number of exchanges in the window.
    pub fn exchanges(&self) -> usize {
        self.exchanges.len()
    }

    fn fit(&self) -> ClockEstimate {
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
        ClockEstimate {
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
        let mut clock = LeaderClock::default();
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
                assert!(error_s.abs() < most_s, "{delay_s} {jitter_s} {drift}: {error_s}");
            }
        }
    }

    #[test]
    fn exchanges_that_cannot_be_are_left_out() {
        let mut clock = LeaderClock::default();
        for _ in 0..10 {
            clock.push(100, 0, 500, 200); // answered after it came back
            clock.push(0, i64::MAX, i64::MIN, 10);
            clock.push(0, 5, 6, 4_000_000_000); // took too long
        }
        assert_eq!((clock.exchanges(), clock.estimate()), (0, None));
    }
}
