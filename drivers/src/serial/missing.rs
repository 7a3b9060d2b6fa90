//! For how long a servo may be missing from the cycles before it is lost.

/// A servo that is missing while others answer is lost after so long, seconds, and so many
/// cycles.
const LOST_ALONE_S: f64 = 0.03;
const LOST_ALONE_CYCLES: u32 = 4;
/// The same where nobody answers: servos that took damage for the length of a packet are
/// deaf until so many bytes have come.
const LOST_S: f64 = 0.12;
pub(super) const LOST_CYCLES: u32 = 3;

/// For how long a servo has been missing from the cycles.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Missing {
    pub since_s: Option<f64>,
    pub cycles: u32,
}

impl Missing {
    /// One more cycle without it, others answering or not; whether it is lost.
    pub fn again(&mut self, now_s: f64, others_answer: bool) -> bool {
        self.cycles += 1;
        let missing_s = now_s - *self.since_s.get_or_insert(now_s);
        match others_answer {
            true => missing_s >= LOST_ALONE_S && self.cycles >= LOST_ALONE_CYCLES,
            false => missing_s >= LOST_S && self.cycles >= LOST_CYCLES,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_servo_is_lost_after_a_while_and_not_after_one_cycle() {
        for (others_answer, cycles) in [(true, 4), (false, 12)] {
            let mut missing = Missing::default();
            let lost = (0..).find(|&cycle| missing.again(f64::from(cycle) * 0.0101, others_answer));
            assert_eq!(lost, Some(cycles - 1 + u32::from(!others_answer)), "{others_answer}");
        }
        let mut slow = Missing::default();
        let lost = (0..).find(|&cycle| slow.again(f64::from(cycle) * 0.5, true));
        assert_eq!(lost, Some(3), "however long a cycle takes");
    }
}
