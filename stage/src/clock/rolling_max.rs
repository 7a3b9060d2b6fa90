//! The maximum of a value over the last 30 s.

/// Length of the window, seconds.
const SECONDS: usize = 30;

#[derive(Clone, Debug)]
pub(crate) struct RollingMax {
    greatest: [f64; SECONDS],
    second: i64,
}

impl Default for RollingMax {
    fn default() -> Self {
        Self { greatest: [0.0; SECONDS], second: i64::MIN }
    }
}

impl RollingMax {
    /// Takes a value at this time.
    pub fn push(&mut self, now_ns: i64, value: f64) {
        let second = now_ns.div_euclid(1_000_000_000);
        let passed = second.saturating_sub(self.second);
        if passed >= SECONDS as i64 || self.second == i64::MIN {
            self.greatest = [0.0; SECONDS];
        } else {
            for between in 1..=passed.max(0) {
                self.greatest[place(self.second + between)] = 0.0;
            }
        }
        self.second = self.second.max(second);
        let slot = &mut self.greatest[place(second)];
        *slot = slot.max(value);
    }

    /// The maximum of the last [`SECONDS`] in which a value came.
    pub fn max(&self) -> f64 {
        self.greatest.iter().copied().fold(0.0, f64::max)
    }
}

fn place(second: i64) -> usize {
    second.rem_euclid(SECONDS as i64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_bad_is_forgotten_after_half_a_minute() {
        let mut worst = RollingMax::default();
        let second = |s: i64| s * 1_000_000_000;
        worst.push(second(-4), 0.9);
        for s in -3..20 {
            worst.push(second(s), 0.1);
            assert_eq!(worst.max(), 0.9, "{s}");
        }
        for s in 20..30 {
            worst.push(second(s), 0.2);
        }
        assert_eq!(worst.max(), 0.2);
        worst.push(second(500), 0.05);
        assert_eq!(worst.max(), 0.05);
    }
}
