//! Negative log likelihood of codes, and its gradient.

use rayon::prelude::*;

use crate::train::autodiff::lanes;

/// Stands for a frame that does not count.
pub(crate) const IGNORED: u32 = u32::MAX;
/// Rows that one thread takes at a time.
const PIECE_ROWS: usize = 128;

/// Mean over the targets that count, label-smoothed; gradient by the logits [rows, classes].
pub(crate) fn nll(logits: &[f32], targets: &[u32], smoothing: f32) -> (f64, Vec<f32>) {
    let classes = logits.len() / targets.len().max(1);
    let count = targets.iter().filter(|t| **t != IGNORED).count().max(1) as f32;
    let mut gradient = vec![0.0; logits.len()];
    let pieces: Vec<f64> = gradient
        .par_chunks_mut(PIECE_ROWS * classes)
        .zip(logits.par_chunks(PIECE_ROWS * classes))
        .zip(targets.par_chunks(PIECE_ROWS))
        .map(|((gradient, logits), targets)| {
            let rows = gradient.chunks_mut(classes).zip(logits.chunks(classes)).zip(targets);
            let counted = rows.filter(|(_, target)| **target != IGNORED);
            counted.map(|((g, l), target)| of_row(g, l, *target as usize, smoothing, count)).sum()
        })
        .collect();
    (pieces.iter().sum::<f64>() / f64::from(count), gradient)
}

fn of_row(gradient: &mut [f32], logits: &[f32], target: usize, smoothing: f32, count: f32) -> f64 {
    let largest = lanes::max(logits);
    for (g, l) in gradient.iter_mut().zip(logits) {
        *g = lanes::exp(l - largest);
    }
    let sum = lanes::sum(gradient);
    let log_sum = largest + sum.ln();
    let even = smoothing / logits.len() as f32;
    let loss = log_sum - (1.0 - smoothing) * logits[target] - even * lanes::sum(logits);
    gradient.iter_mut().for_each(|g| *g = (*g / sum - even) / count);
    gradient[target] -= (1.0 - smoothing) / count;
    f64::from(loss)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_logits_cost_the_logarithm_of_their_number() {
        let (loss, gradient) = nll(&[0.5; 12], &[0, IGNORED, 3], 0.0);
        assert!((loss - 4f64.ln()).abs() < 1e-6);
        let expected = [-0.375, 0.125, 0.125, 0.125, 0.0, 0.0, 0.0, 0.0];
        for (g, e) in gradient.iter().zip(expected) {
            assert!((g - e).abs() < 1e-6, "{gradient:?}");
        }
    }

    #[test]
    fn gradient_is_that_of_the_loss() {
        let logits: Vec<f32> = (0..10).map(|i| (i as f32 * 1.7).sin()).collect();
        let targets = [4, 1];
        let (_, gradient) = nll(&logits, &targets, 0.1);
        for i in 0..logits.len() {
            let at = |step: f32| {
                let mut moved = logits.clone();
                moved[i] += step;
                nll(&moved, &targets, 0.1).0
            };
            let slope = (at(1e-2) - at(-1e-2)) / 2e-2;
            assert!((slope - f64::from(gradient[i])).abs() < 1e-4, "{i}");
        }
    }
}
