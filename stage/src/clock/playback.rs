//! Playback time: the moment of the motion that the robot shows, at an even pace
//! even if the estimate of the leader's clock jumps.
//!
//! The pace, between [`SLOWEST`] and [`FASTEST`], changes gently until the shown
//! time is the due time: a correction of a millisecond is invisible, one of a beat
//! is a dance a little slower or faster. Hidden motion may jump. Seconds of motion.

/// The slowest and the fastest pace.
const SLOWEST: f64 = 0.8;
const FASTEST: f64 = 1.25;
/// Share of the error that is corrected in a second.
const HOMING_PER_S: f64 = 3.0;
/// Fastest change of the pace, 1/s.
const PACE_CHANGE_PER_S: f64 = 6.0;

/// The clock of the shown motion.
#[derive(Clone, Debug)]
pub struct PlaybackClock {
    period_s: f64,
    shown_s: Option<f64>,
    pace: f64,
}

impl PlaybackClock {
    /// A clock that is advanced every `period_s` seconds.
    pub fn new(period_s: f64) -> Self {
        Self { period_s, shown_s: None, pace: 1.0 }
    }

    /// Advances one cycle and returns the moment to show. `due_s`: the moment that
    /// is due, `None` while unknown. Motion that is `hidden` may jump.
    pub fn next(&mut self, due_s: Option<f64>, hidden: bool) -> f64 {
        let expected_s = self.shown_s.map(|shown_s| shown_s + self.period_s);
        let next_s = match (expected_s, due_s) {
            (None, None) => 0.0,
            (Some(expected_s), None) => expected_s,
            (Some(expected_s), Some(due_s)) if !hidden => {
                let wanted = 1.0 + HOMING_PER_S * (due_s - expected_s);
                let most = PACE_CHANGE_PER_S * self.period_s;
                let change = wanted.clamp(SLOWEST, FASTEST) - self.pace;
                self.pace += change.clamp(-most, most);
                expected_s + (self.pace - 1.0) * self.period_s
            }
            (_, Some(due_s)) => {
                self.pace = 1.0;
                due_s
            }
        };
        self.shown_s = Some(next_s);
        next_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE_S: f64 = 0.01;

    #[test]
    fn what_is_due_is_reached_gently_and_held() {
        for jump_s in [0.004, -0.004, 0.5, -0.5] {
            let mut clock = PlaybackClock::new(CYCLE_S);
            let mut last_s = clock.next(Some(0.0), true);
            for cycle in 1..2000 {
                let due_s = f64::from(cycle) * CYCLE_S + jump_s;
                let shown_s = clock.next(Some(due_s), false);
                let pace = (shown_s - last_s) / CYCLE_S;
                assert!((SLOWEST - 1e-9..=FASTEST + 1e-9).contains(&pace), "{pace}");
                if cycle > 600 {
                    assert!((shown_s - due_s).abs() < 1e-5, "{jump_s}: {shown_s} {due_s}");
                }
                last_s = shown_s;
            }
        }
    }

    #[test]
    fn time_goes_on_alone_and_hidden_motion_jumps() {
        let mut clock = PlaybackClock::new(CYCLE_S);
        assert_eq!(clock.next(None, true), 0.0);
        assert_eq!(clock.next(None, true), CYCLE_S);
        assert_eq!(clock.next(Some(70.0), true), 70.0);
        assert!((clock.next(Some(80.0), false) - 70.01).abs() < 1e-3);
    }
}
