//! By how many seconds motion is sent ahead of the music; below zero when live
//! audio cannot be known ahead.

/// The lead without steering, and the mean over the cycles.
#[derive(Clone, Copy, Debug)]
pub struct LeadTime {
    even_s: f64,
    sum_s: f64,
    cycles: u64,
}

impl LeadTime {
    /// No cycle yet; without compensation the lead is always `even_s`.
    pub fn new(even_s: f64) -> Self {
        Self { even_s, sum_s: 0.0, cycles: 0 }
    }

    /// Lead where nothing steers the motion, seconds.
    pub fn even_s(&self) -> f64 {
        self.even_s
    }

    pub fn push(&mut self, lead_s: f64) {
        self.sum_s += lead_s;
        self.cycles += 1;
    }

    /// Mean over the cycles so far, seconds.
    pub fn mean_s(&self) -> f64 {
        match self.cycles {
            0 => self.even_s,
            cycles => self.sum_s / cycles as f64,
        }
    }
}
