//! Means with their 95 % intervals.

use super::figures::mean;
use serde::Serialize;

/// A mean with its 95 % interval (1.96 standard errors to each side).
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct MeanEstimate {
    pub(crate) mean: f64,
    pub(crate) ci95: f64,
}

impl MeanEstimate {
    pub(super) fn of(values: &[f64]) -> Self {
        let mean = mean(values);
        let n = values.len() as f64;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        let ci95 = if n > 1.0 { 1.96 * (squares / (n - 1.0) / n).sqrt() } else { 0.0 };
        Self { mean, ci95 }
    }
}

pub(super) fn cell(estimate: MeanEstimate) -> String {
    format!("{:.3} +- {:.3}", estimate.mean, estimate.ci95)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_that_of_the_textbook() {
        // Standard deviation 2, four values: 1.96 * 2 / 2.
        let s = 3f64.sqrt();
        let estimate = MeanEstimate::of(&[5.0 - s, 5.0 - s, 5.0 + s, 5.0 + s]);
        assert!((estimate.mean - 5.0).abs() < 1e-12);
        assert!((estimate.ci95 - 1.96).abs() < 1e-9, "{estimate:?}");
    }
}
