//! For how long a bus was silent: as long as the servos' own watchdogs, and they may have
//! stopped their servos. The time from cycle to cycle costs nothing to know.

/// A silence of this share of the watchdogs' time is enough to ask.
const DOUBTFUL: f64 = 0.8;

#[derive(Debug, Default)]
pub(super) struct BusSilence {
    /// When the last cycle began, seconds by the bus's clock.
    pub spoke_s: f64,
    /// How long the last silence was whose end nobody has been asked about, seconds.
    pub doubtful_s: Option<f64>,
}

impl BusSilence {
    /// Somebody spoke, and nobody is stopped.
    pub fn end(&mut self, now_s: f64) {
        *self = Self { spoke_s: now_s, doubtful_s: None };
    }

    /// A cycle begins; how long the silence was that everyone is to be asked about.
    pub fn begin_cycle(&mut self, now_s: f64, watchdog_s: f64) -> Option<f64> {
        let silent_s = now_s - self.spoke_s;
        self.spoke_s = now_s;
        if silent_s >= DOUBTFUL * watchdog_s {
            self.doubtful_s = Some(silent_s.max(self.doubtful_s.unwrap_or(0.0)));
        }
        self.doubtful_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_silence_as_long_as_the_watchdog_is_doubtful_until_it_is_answered_for() {
        let mut silence = BusSilence::default();
        silence.end(1.0);
        assert_eq!(silence.begin_cycle(1.01, 0.16), None);
        assert_eq!(silence.begin_cycle(1.13, 0.16), None, "a hiccup");
        assert!(
            silence.begin_cycle(1.63, 0.16).is_some_and(|silent_s| (silent_s - 0.5).abs() < 1e-9)
        );
        assert!(silence.begin_cycle(1.64, 0.16).is_some(), "nobody was asked yet");
        silence.end(1.65);
        assert_eq!(silence.begin_cycle(1.66, 0.16), None);
    }
}
