//! Two sets of motions compared: Fréchet distance (FID) and diversity (Dist).
//!
//! Both sets are normalised by the **real** set's mean and deviation: a set
//! normalised by its own would hide wrong scale and shift.

use nalgebra::DMatrix;

/// Feature vectors of one set of motions, all of one length.
pub type FeatureVectors = Vec<Vec<f64>>;

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DistributionError {
    /// A covariance needs two motions at least.
    #[error("{set} set has {count} motions, at least 2 are needed")]
    TooFew {
        /// `yardstick`, `real` or `generated`.
        set: &'static str,
        count: usize,
    },
    #[error("a feature vector has {actual} numbers, {expected} expected")]
    Length { actual: usize, expected: usize },
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distribution {
    pub fid: f64,
    /// Mean distance between two generated motions.
    pub dist: f64,
    /// Mean distance between two real motions: what `dist` should be near.
    pub dist_real: f64,
}

/// Compares the features of generated motions with those of real ones, both
/// normalised by `yardstick`: the real set, or the whole that two compared parts
/// come from. Features that do not vary in the yardstick count unscaled.
pub fn compare(
    yardstick: &FeatureVectors,
    real: &FeatureVectors,
    generated: &FeatureVectors,
) -> Result<Distribution, DistributionError> {
    let sets = [("yardstick", yardstick), ("real", real), ("generated", generated)];
    for (set, features) in sets {
        let count = features.len();
        if count < 2 {
            return Err(DistributionError::TooFew { set, count });
        }
    }
    let expected = yardstick[0].len();
    let all = yardstick.iter().chain(real).chain(generated);
    if let Some(other) = all.into_iter().find(|v| v.len() != expected) {
        let actual = other.len();
        return Err(DistributionError::Length { actual, expected });
    }
    let mean = mean(yardstick);
    let deviation: Vec<f64> = (0..expected)
        .map(|k| {
            let sum: f64 = yardstick.iter().map(|v| (v[k] - mean[k]).powi(2)).sum();
            let deviation = (sum / yardstick.len() as f64).sqrt();
            if deviation > 1e-9 { deviation } else { 1.0 }
        })
        .collect();
    let normal = |features: &FeatureVectors| -> FeatureVectors {
        let one = |v: &Vec<f64>| (0..expected).map(|k| (v[k] - mean[k]) / deviation[k]).collect();
        features.iter().map(one).collect()
    };
    let (real, generated) = (normal(real), normal(generated));
    Ok(Distribution {
        fid: frechet(&real, &generated),
        dist: mean_distance(&generated),
        dist_real: mean_distance(&real),
    })
}

fn mean(features: &FeatureVectors) -> Vec<f64> {
    let sum = |k: usize| features.iter().map(|v| v[k]).sum::<f64>();
    (0..features[0].len()).map(|k| sum(k) / features.len() as f64).collect()
}

fn mean_distance(features: &FeatureVectors) -> f64 {
    let (mut sum, mut pairs) = (0.0, 0);
    for (i, a) in features.iter().enumerate() {
        for b in &features[..i] {
            let squared: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
            sum += squared.sqrt();
            pairs += 1;
        }
    }
    sum / f64::from(pairs)
}

/// |m1 - m2|^2 + tr(C1 + C2 - 2 (C1 C2)^1/2), with the trace of the root from
/// the symmetric C1^1/2 C2 C1^1/2, which has the same eigenvalues.
fn frechet(a: &FeatureVectors, b: &FeatureVectors) -> f64 {
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (cov_a, cov_b) = (covariance(a, &mean_a), covariance(b, &mean_b));
    let shift: f64 = mean_a.iter().zip(&mean_b).map(|(a, b)| (a - b).powi(2)).sum();
    let root = symmetric_root(cov_a.clone());
    let cross = (&root * &cov_b * &root).symmetric_eigenvalues();
    let cross: f64 = cross.iter().map(|v| v.max(0.0).sqrt()).sum();
    // Rounding alone could make it negative.
    (shift + cov_a.trace() + cov_b.trace() - 2.0 * cross).max(0.0)
}

fn covariance(features: &FeatureVectors, mean: &[f64]) -> DMatrix<f64> {
    let centred = |n: usize, k: usize| features[n][k] - mean[k];
    let centred = DMatrix::from_fn(features.len(), mean.len(), centred);
    centred.tr_mul(&centred) / (features.len() - 1) as f64
}

/// The root of a symmetric matrix without negative eigenvalues.
fn symmetric_root(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let eigen = matrix.symmetric_eigen();
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    &eigen.eigenvectors * DMatrix::from_diagonal(&roots) * eigen.eigenvectors.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    // Made by golden.py.
    const GOLDEN_FID: f64 = 2.0759522039498943;
    const GOLDEN_DISTANCE: f64 = 3.018135564363522;

    fn set(formula: impl Fn(f64, f64) -> f64) -> FeatureVectors {
        (0..30).map(|n| (0..5).map(|k| formula(f64::from(n), f64::from(k))).collect()).collect()
    }

    fn real() -> FeatureVectors {
        set(|n, k| (1.3 * n + 2.1 * k).sin() * (1.0 + k) + 0.5 * k)
    }

    #[test]
    fn distances_match_the_independent_script() {
        let made =
            set(|n, k| (0.7 * n + 1.9 * k).cos() * (1.5 + 0.5 * k) + 0.3 * (n * (k + 1.0)).sin());
        let result = compare(&real(), &real(), &made).unwrap();
        assert!((result.fid - GOLDEN_FID).abs() < 1e-6, "{result:?}");
        assert!((result.dist - GOLDEN_DISTANCE).abs() < 1e-9, "{result:?}");
    }

    #[test]
    fn a_set_is_no_distance_from_itself() {
        let result = compare(&real(), &real(), &real()).unwrap();
        assert!(result.fid < 1e-6, "{result:?}");
        assert_eq!(result.dist, result.dist_real);
    }

    #[test]
    fn a_shift_by_one_deviation_costs_one_a_feature() {
        let n = 30.0;
        let mut moved = real();
        for k in 0..5 {
            let mean = moved.iter().map(|v| v[k]).sum::<f64>() / n;
            let squares: f64 = moved.iter().map(|v| (v[k] - mean).powi(2)).sum();
            let deviation = (squares / n).sqrt();
            moved.iter_mut().for_each(|v| v[k] += deviation);
        }
        let result = compare(&real(), &real(), &moved).unwrap();
        assert!((result.fid - 5.0).abs() < 1e-6, "{result:?}");
    }

    #[test]
    fn twice_the_size_is_twice_as_diverse() {
        let mut large = real();
        large.iter_mut().flatten().for_each(|v| *v *= 2.0);
        let result = compare(&real(), &real(), &large).unwrap();
        assert!((result.dist / result.dist_real - 2.0).abs() < 1e-9);
    }

    #[test]
    fn too_few_motions_are_named() {
        let error = compare(&real(), &real(), &vec![vec![0.0; 5]]).unwrap_err();
        assert_eq!(error.to_string(), "generated set has 1 motions, at least 2 are needed");
    }
}
