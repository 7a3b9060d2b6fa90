//! A joint that does not move at all while its command does: its servo may be stopped by
//! its own watchdog.

/// A joint that has not moved for so long while its command went on by so much is asked.
const STILL_S: f64 = 0.05;
const WENT_ON_RAD: f64 = 0.05;
/// More than the noise of an encoder.
const MOVED_RAD: f64 = 0.0025;
/// It is not asked again for so long.
const ASK_AGAIN_S: f64 = 0.25;

/// Whether a joint moves at all while its command does.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stillness {
    position_rad: f64,
    sent_rad: f64,
    since_s: f64,
    asked_s: Option<f64>,
}

impl Stillness {
    /// Where it is and what it was told; true if that looks like a stopped servo.
    pub fn looks_stopped(&mut self, now_s: f64, position_rad: f64, sent_rad: f64) -> bool {
        if (position_rad - self.position_rad).abs() > MOVED_RAD || now_s < self.since_s {
            *self = Self { position_rad, sent_rad, since_s: now_s, asked_s: self.asked_s };
            return false;
        }
        let asked = self.asked_s.is_some_and(|asked_s| now_s - asked_s < ASK_AGAIN_S);
        let stopped = !asked
            && now_s - self.since_s > STILL_S
            && (sent_rad - self.sent_rad).abs() > WENT_ON_RAD;
        if stopped {
            self.asked_s = Some(now_s);
        }
        stopped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_that_stands_while_its_command_goes_on_looks_stopped() {
        let mut joint = Stillness::default();
        let mut asked = 0;
        for k in 0..40 {
            let now_s = f64::from(k) * 0.01;
            asked += u32::from(joint.looks_stopped(now_s, 0.0, 0.01 * f64::from(k)));
        }
        assert_eq!(asked, 2, "once, and once again a quarter of a second later");
    }

    #[test]
    fn one_that_follows_late_or_rests_does_not() {
        let (mut late, mut resting) = (Stillness::default(), Stillness::default());
        for k in 0..400 {
            let now_s = f64::from(k) * 0.01;
            let position = |at_s: f64| (2.0 * at_s.max(0.0)).sin();
            assert!(!late.looks_stopped(now_s, position(now_s - 0.05), position(now_s)), "{k}");
            assert!(!resting.looks_stopped(now_s, 0.3, 0.31), "{k}");
        }
    }
}
