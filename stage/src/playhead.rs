//! Which moment of the motion is shown: at an even pace, wherever the estimate
//! of the leader's clock jumps to.
//!
//! What is due and what is shown are brought together by the pace, between
//! [`SLOWEST`] and [`FASTEST`], which changes gently: a correction of a
//! millisecond is not seen, one of a beat is seen as a dance a little slower or
//! faster. Motion that is not seen may jump. Seconds of motion.

/// The slowest and the fastest pace.
const SLOWEST: f64 = 0.8;
const FASTEST: f64 = 1.25;
/// Share of the way home in a second.
const HOMING_PER_S: f64 = 3.0;
/// Fastest change of the pace, 1/s.
const PACE_CHANGE_PER_S: f64 = 6.0;

/// The moment that is shown.
#[derive(Clone, Debug)]
pub struct Playhead {
    period_s: f64,
    shown_s: Option<f64>,
    pace: f64,
}

impl Playhead {
    /// One that is asked every `period_s`.
    pub fn new(period_s: f64) -> Self {
        Self {
            period_s,
            shown_s: None,
            pace: 1.0,
        }
    }

    /// The moment to show in this cycle; `due_s` if nothing hinders it, `None`
    /// while nobody knows. Motion that is `hidden` may jump.
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
            let mut playhead = Playhead::new(CYCLE_S);
            let mut last_s = playhead.next(Some(0.0), true);
            for cycle in 1..2000 {
                let due_s = f64::from(cycle) * CYCLE_S + jump_s;
                let shown_s = playhead.next(Some(due_s), false);
                let pace = (shown_s - last_s) / CYCLE_S;
                assert!((SLOWEST - 1e-9..=FASTEST + 1e-9).contains(&pace), "{pace}");
                if cycle > 600 {
                    assert!(
                        (shown_s - due_s).abs() < 1e-5,
                        "{jump_s}: {shown_s} {due_s}"
                    );
                }
                last_s = shown_s;
            }
        }
    }

    #[test]
    fn time_goes_on_alone_and_hidden_motion_jumps() {
        let mut playhead = Playhead::new(CYCLE_S);
        assert_eq!(playhead.next(None, true), 0.0);
        assert_eq!(playhead.next(None, true), CYCLE_S);
        assert_eq!(playhead.next(Some(70.0), true), 70.0);
        assert!((playhead.next(Some(80.0), false) - 70.01).abs() < 1e-3);
    }
}
