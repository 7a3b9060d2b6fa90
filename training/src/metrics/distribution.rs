//! Two sets of motions compared: Fréchet distance (FID) and diversity (Dist).
//!
//! Both sets are normalised by the **real** set's mean and deviation. A set
//! normalised by its own would hide wrong scale and shift.

/// Feature vectors of one set of motions, all of one length.
pub type Features = Vec<Vec<f64>>;

/// Why two sets cannot be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DistributionError {
    /// A covariance needs two motions at least.
    #[error("{set} set has {count} motions, at least 2 are needed")]
    TooFew {
        /// `yardstick`, `real` or `generated`.
        set: &'static str,
        /// How many there are.
        count: usize,
    },
    /// The vectors have different lengths.
    #[error("a feature vector has {actual} numbers, {expected} expected")]
    Length {
        /// Numbers of the vector.
        actual: usize,
        /// Numbers of the first vector.
        expected: usize,
    },
}

/// Generated motion against real motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distribution {
    /// Fréchet distance between Gaussians fitted to both sets.
    pub fid: f64,
    /// Mean distance between two generated motions.
    pub dist: f64,
    /// Mean distance between two real motions: what `dist` should be near.
    pub dist_real: f64,
}

/// Compares the features of generated motions with those of real ones.
/// Features that do not vary in the real set count unscaled.
pub fn compare(real: &Features, generated: &Features) -> Result<Distribution, DistributionError> {
    compare_by(real, real, generated)
}

/// The same, normalised by a third set: for two parts of one real set, which
/// are to be measured with the yardstick of the whole.
pub fn compare_by(
    yardstick: &Features,
    real: &Features,
    generated: &Features,
) -> Result<Distribution, DistributionError> {
    let sets = [
        ("yardstick", yardstick),
        ("real", real),
        ("generated", generated),
    ];
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
    let normal = |features: &Features| -> Features {
        let one = |v: &Vec<f64>| {
            (0..expected)
                .map(|k| (v[k] - mean[k]) / deviation[k])
                .collect()
        };
        features.iter().map(one).collect()
    };
    let (real, generated) = (normal(real), normal(generated));
    Ok(Distribution {
        fid: frechet(&real, &generated),
        dist: mean_distance(&generated),
        dist_real: mean_distance(&real),
    })
}

fn mean(features: &Features) -> Vec<f64> {
    let sum = |k: usize| features.iter().map(|v| v[k]).sum::<f64>();
    (0..features[0].len())
        .map(|k| sum(k) / features.len() as f64)
        .collect()
}

fn mean_distance(features: &Features) -> f64 {
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
fn frechet(a: &Features, b: &Features) -> f64 {
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (cov_a, cov_b) = (covariance(a, &mean_a), covariance(b, &mean_b));
    let shift: f64 = mean_a
        .iter()
        .zip(&mean_b)
        .map(|(a, b)| (a - b).powi(2))
        .sum();
    let root = cov_a.clone().symmetric_root();
    let (values, _) = root.times(&cov_b).times(&root).eigen();
    let cross: f64 = values.iter().map(|v| v.max(0.0).sqrt()).sum();
    // Rounding alone could make it negative.
    (shift + cov_a.trace() + cov_b.trace() - 2.0 * cross).max(0.0)
}

fn covariance(features: &Features, mean: &[f64]) -> Matrix {
    let n = mean.len();
    let mut out = Matrix::zeros(n);
    for v in features {
        for i in 0..n {
            for j in 0..n {
                out.0[i][j] += (v[i] - mean[i]) * (v[j] - mean[j]);
            }
        }
    }
    let count = (features.len() - 1) as f64;
    out.0.iter_mut().flatten().for_each(|value| *value /= count);
    out
}

/// A square matrix, row by row.
#[derive(Clone)]
struct Matrix(Vec<Vec<f64>>);

impl Matrix {
    fn zeros(n: usize) -> Self {
        Self(vec![vec![0.0; n]; n])
    }

    fn trace(&self) -> f64 {
        self.0.iter().enumerate().map(|(i, row)| row[i]).sum()
    }

    fn times(&self, other: &Self) -> Self {
        let n = self.0.len();
        let mut out = Self::zeros(n);
        for (row, target) in self.0.iter().zip(&mut out.0) {
            for (value, other_row) in row.iter().zip(&other.0) {
                for (sum, x) in target.iter_mut().zip(other_row) {
                    *sum += value * x;
                }
            }
        }
        out
    }

    /// The root of a symmetric matrix without negative eigenvalues.
    fn symmetric_root(self) -> Self {
        let n = self.0.len();
        let (values, vectors) = self.eigen();
        let mut out = Self::zeros(n);
        for i in 0..n {
            for j in 0..n {
                out.0[i][j] = (0..n)
                    .map(|k| vectors.0[i][k] * values[k].max(0.0).sqrt() * vectors.0[j][k])
                    .sum();
            }
        }
        out
    }

    /// Eigenvalues and eigenvectors (columns) of a symmetric matrix, by
    /// Jacobi's rotations.
    fn eigen(mut self) -> (Vec<f64>, Self) {
        let n = self.0.len();
        let a = &mut self.0;
        let mut vectors = Self::zeros(n);
        for (i, row) in vectors.0.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        let scale: f64 = a.iter().flatten().map(|v| v * v).sum();
        for _ in 0..60 {
            let mut off = 0.0;
            for p in 0..n {
                for q in p + 1..n {
                    off += a[p][q] * a[p][q];
                    if a[p][q].abs() < 1e-300 {
                        continue;
                    }
                    let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                    let c = 1.0 / (t * t + 1.0).sqrt();
                    let s = t * c;
                    for row in a.iter_mut() {
                        (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                    }
                    let (upper, lower) = a.split_at_mut(q);
                    for (x, y) in upper[p].iter_mut().zip(&mut lower[0]) {
                        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
                    }
                    for row in vectors.0.iter_mut() {
                        (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                    }
                }
            }
            if off <= 1e-24 * scale {
                break;
            }
        }
        ((0..n).map(|i| a[i][i]).collect(), vectors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Made by golden.py.
    const GOLDEN_FID: f64 = 2.0759522039498943;
    const GOLDEN_DISTANCE: f64 = 3.018135564363522;

    fn set(formula: impl Fn(f64, f64) -> f64) -> Features {
        (0..30)
            .map(|n| {
                (0..5)
                    .map(|k| formula(f64::from(n), f64::from(k)))
                    .collect()
            })
            .collect()
    }

    fn real() -> Features {
        set(|n, k| (1.3 * n + 2.1 * k).sin() * (1.0 + k) + 0.5 * k)
    }

    #[test]
    fn distances_match_the_independent_script() {
        let made =
            set(|n, k| (0.7 * n + 1.9 * k).cos() * (1.5 + 0.5 * k) + 0.3 * (n * (k + 1.0)).sin());
        let result = compare(&real(), &made).unwrap();
        assert!((result.fid - GOLDEN_FID).abs() < 1e-6, "{result:?}");
        assert!((result.dist - GOLDEN_DISTANCE).abs() < 1e-9, "{result:?}");
    }

    #[test]
    fn a_set_is_no_distance_from_itself() {
        let result = compare(&real(), &real()).unwrap();
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
        let result = compare(&real(), &moved).unwrap();
        assert!((result.fid - 5.0).abs() < 1e-6, "{result:?}");
    }

    #[test]
    fn twice_the_size_is_twice_as_diverse() {
        let mut large = real();
        large.iter_mut().flatten().for_each(|v| *v *= 2.0);
        let result = compare(&real(), &large).unwrap();
        assert!((result.dist / result.dist_real - 2.0).abs() < 1e-9);
    }

    #[test]
    fn too_few_motions_are_named() {
        let error = compare(&real(), &vec![vec![0.0; 5]]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "generated set has 1 motions, at least 2 are needed"
        );
    }
}
