//! Feed-forward of velocity: a servo makes fast movements smaller and later than its targets, so
//! its target is ahead of where it is to be by its velocity times a part of its lag.

/// Radians and seconds; of all joints.
pub(crate) struct FeedForward {
    ahead_s: f64,
    /// The targets of the last cycle, where there were any.
    last: Vec<Option<f64>>,
}

impl FeedForward {
    /// None yet.
    pub fn new(joints: usize) -> Self {
        Self { ahead_s: 0.0, last: vec![None; joints] }
    }

    pub fn set(&mut self, seconds: f64) {
        self.ahead_s = if seconds.is_finite() { seconds.max(0.0) } else { 0.0 };
    }

    /// Forgets the last targets, which the next ones do not go on from.
    pub fn restart(&mut self) {
        self.last.fill(None);
    }

    /// What to tell a servo that is to be at `target`, `dt_s` after its last one. A target that
    /// jumps is gone to at the joint's speed.
    pub fn ahead_of(&mut self, joint: usize, target: f64, speed_limit: f64, dt_s: f64) -> f64 {
        let last = self.last[joint].replace(target).unwrap_or(target);
        let velocity = ((target - last) / dt_s).clamp(-speed_limit, speed_limit);
        target + self.ahead_s * velocity
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moving_targets_are_ahead_and_still_ones_are_not() {
        let mut ahead = FeedForward::new(1);
        let mut told = |target| ahead.ahead_of(0, target, 4.0, 0.01);
        assert_eq!([told(1.0), told(1.01)], [1.0, 1.01]);
        ahead.set(0.03);
        let mut told = |target| ahead.ahead_of(0, target, 4.0, 0.01);
        assert!((told(1.03) - 1.09).abs() < 1e-9);
        assert_eq!(told(1.03), 1.03);
        // A jump of a radian is no speed of 100 rad/s.
        assert!((told(2.03) - 2.15).abs() < 1e-9);
        ahead.restart();
        assert_eq!(ahead.ahead_of(0, 5.0, 4.0, 0.01), 5.0);
    }
}
