//! Means between two lines of the curves, and the best score so far.

use super::network_training::NamedValues;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CurveTally {
    /// Sums since the last line, by column.
    pub sums: NamedValues,
    pub count: u64,
    /// The best score so far, and how many lines ago it was.
    pub best: f64,
    pub since_best: u64,
}

impl CurveTally {
    pub fn add(&mut self, terms: &NamedValues) {
        if self.sums.len() != terms.len() {
            self.sums = terms.iter().map(|(name, _)| (name.clone(), 0.0)).collect();
            self.count = 0;
        }
        for (sum, (_, value)) in self.sums.iter_mut().zip(terms) {
            sum.1 += value;
        }
        self.count += 1;
    }

    pub fn take_means(&mut self) -> NamedValues {
        let count = self.count.max(1) as f64;
        let means = self.sums.iter().map(|(name, sum)| (name.clone(), sum / count)).collect();
        (self.sums, self.count) = (Vec::new(), 0);
        means
    }
}
