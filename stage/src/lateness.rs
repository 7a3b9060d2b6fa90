//! The worst of late: the greatest value of each of the last seconds.

/// Seconds that count.
const SECONDS: usize = 30;

/// Greatest values, one a second.
#[derive(Clone, Debug)]
pub(crate) struct Worst {
    greatest: [f64; SECONDS],
    second: i64,
}

impl Default for Worst {
    fn default() -> Self {
        Self {
            greatest: [0.0; SECONDS],
            second: i64::MIN,
        }
    }
}

impl Worst {
    /// Takes in a value of this moment.
    pub fn note(&mut self, now_ns: i64, value: f64) {
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

    /// The greatest of the last [`SECONDS`] in which something was noted.
    pub fn of_late(&self) -> f64 {
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
        let mut worst = Worst::default();
        let second = |s: i64| s * 1_000_000_000;
        worst.note(second(-4), 0.9);
        for s in -3..20 {
            worst.note(second(s), 0.1);
            assert_eq!(worst.of_late(), 0.9, "{s}");
        }
        for s in 20..30 {
            worst.note(second(s), 0.2);
        }
        assert_eq!(worst.of_late(), 0.2);
        worst.note(second(500), 0.05);
        assert_eq!(worst.of_late(), 0.05);
    }
}
