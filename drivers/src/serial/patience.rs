//! How long the answer to a cycle's question is waited for.
//!
//! It is learnt: a bus that answers after a millisecond is not waited for 20 ms, which
//! would cost two cycles for each lost answer. What does not come in time makes the
//! patience longer again, up to `reply_timeout_ms`.

use std::time::Duration;

/// Patience beyond the time on the wire: this many times the slowest answer of late, and
/// so much more.
const TIMES: f64 = 3.0;
const MARGIN_S: f64 = 3e-3;
/// The same where there is time in the period to ask again, and by how much it grows with
/// a loss.
const SHORT_TIMES: f64 = 2.0;
const SHORT_MARGIN_S: f64 = 2e-3;
const SHORT_LONGER: (f64, f64) = (1.1, 1e-4);
/// ... and at least this share of `reply_timeout_ms`: both machines may be busy.
const LEAST_SHARE: f64 = 0.3;
/// The slowest answer is forgotten by this share a cycle; so much longer after a loss.
const FORGET: f64 = 0.02;
const LONGER: f64 = 1.5;

/// How long the answer to a cycle's question is waited for, beyond its time on the wire.
#[derive(Clone, Copy, Debug, Default)]
pub struct Patience {
    slowest_s: f64,
    short_s: f64,
    wait_s: Option<f64>,
}

impl Patience {
    /// What was learnt, at most `longest_s`; `None` before the first answer.
    pub fn wait(&self, longest_s: f64) -> Option<Duration> {
        let learnt = |wait_s: f64| wait_s.max(LEAST_SHARE * longest_s).min(longest_s);
        self.wait_s.map(|wait_s| Duration::from_secs_f64(learnt(wait_s)))
    }

    /// How long an answer is waited for where there is time in the period to ask again;
    /// `None` before the first answer.
    pub fn short_wait(&self, longest_s: f64) -> Option<Duration> {
        self.wait(longest_s).map(|wait| wait.min(Duration::from_secs_f64(self.short_s)))
    }

    /// A whole answer came so long after its time on the wire, seconds.
    pub fn answered(&mut self, late_s: f64) {
        self.slowest_s = late_s.max(self.slowest_s * (1.0 - FORGET)).max(0.0);
        self.wait_s = Some(TIMES * self.slowest_s + MARGIN_S);
        let short_s = SHORT_TIMES * late_s + SHORT_MARGIN_S;
        self.short_s = short_s.max(self.short_s * (1.0 - FORGET));
    }

    /// Something did not come.
    pub fn lost(&mut self, longest_s: f64) {
        self.wait_s = self.wait_s.map(|wait_s| (LONGER * wait_s).min(longest_s));
        self.short_s = (SHORT_LONGER.0 * self.short_s + SHORT_LONGER.1).min(longest_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patience_is_learnt_and_grows_when_answers_are_late() {
        let mut patience = Patience::default();
        assert_eq!(patience.wait(0.02), None);
        patience.lost(0.02);
        assert_eq!(patience.wait(0.02), None, "nothing was learnt yet");
        patience.answered(1e-3);
        let wait_s = |patience: &Patience| patience.wait(0.02).unwrap().as_secs_f64();
        assert!((wait_s(&patience) - 6e-3).abs() < 1e-9);
        (0..10).for_each(|_| patience.lost(0.02));
        assert_eq!(wait_s(&patience), 0.02);
        patience.answered(1e-3);
        assert!((wait_s(&patience) - 6e-3).abs() < 1e-9);
        patience.answered(0.0);
        assert!((wait_s(&patience) - 6e-3).abs() < 1e-3, "a share of the timeout");
        patience.answered(0.1);
        assert_eq!(wait_s(&patience), 0.02);
        (0..500).for_each(|_| patience.answered(5e-4));
        let short_s = |patience: &Patience| patience.short_wait(0.02).unwrap().as_secs_f64();
        assert!((short_s(&patience) - 3e-3).abs() < 1e-9);
        (0..50).for_each(|_| patience.lost(0.02));
        assert_eq!(short_s(&patience), 0.02, "an answer that is always late is waited for");
    }
}
