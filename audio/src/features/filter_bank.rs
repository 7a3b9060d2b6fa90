//! Filter banks over the bins of a spectrum: mel bands and arbitrary weights.

/// Filters over the bins of a spectrum, stored sparsely.
pub(crate) struct FilterBank {
    filters: Vec<(usize, Vec<f32>)>,
}

impl FilterBank {
    /// Mel bands after Slaney's Auditory Toolbox with area normalisation, as
    /// `librosa.filters.mel` makes them: linear below 1 kHz, then logarithmic.
    pub(crate) fn mel(bands: usize, highest_hz: f64, bin_hz: f64, bins: usize) -> Self {
        let top = hz_to_mel(highest_hz);
        let edge = |i: usize| mel_to_hz(top * i as f64 / (bands + 1) as f64);
        let filters = (0..bands)
            .map(|band| {
                let (low, middle, high) = (edge(band), edge(band + 1), edge(band + 2));
                let area = 2.0 / (high - low);
                dense_to_sparse((0..bins).map(|bin| {
                    let hz = bin as f64 * bin_hz;
                    let rise = (hz - low) / (middle - low);
                    let fall = (high - hz) / (high - middle);
                    (area * rise.min(fall).max(0.0)) as f32
                }))
            })
            .collect();
        Self { filters }
    }

    /// Filters from a weight for each pair of filter and bin.
    pub(crate) fn from_weights(
        count: usize,
        bins: usize,
        weight: impl Fn(usize, usize) -> f32,
    ) -> Self {
        let filters = (0..count)
            .map(|filter| dense_to_sparse((0..bins).map(|bin| weight(filter, bin))))
            .collect();
        Self { filters }
    }

    /// Writes the weighted sum of `bins` under each filter to `out`.
    pub(crate) fn apply(&self, bins: &[f32], out: &mut [f32]) {
        for (value, (first, weights)) in out.iter_mut().zip(&self.filters) {
            *value = weights.iter().zip(&bins[*first..]).map(|(w, b)| w * b).sum();
        }
    }
}

fn dense_to_sparse(weights: impl Iterator<Item = f32>) -> (usize, Vec<f32>) {
    let dense: Vec<f32> = weights.collect();
    let first = dense.iter().position(|&w| w > 0.0).unwrap_or(0);
    let last = dense.iter().rposition(|&w| w > 0.0).map_or(first, |l| l + 1);
    (first, dense[first..last].to_vec())
}

const MEL_LINEAR_HZ: f64 = 200.0 / 3.0;
const MEL_LOG_START_HZ: f64 = 1000.0;

fn hz_to_mel(hz: f64) -> f64 {
    if hz < MEL_LOG_START_HZ {
        hz / MEL_LINEAR_HZ
    } else {
        MEL_LOG_START_HZ / MEL_LINEAR_HZ + (hz / MEL_LOG_START_HZ).ln() / (6.4f64.ln() / 27.0)
    }
}

fn mel_to_hz(mel: f64) -> f64 {
    let start = MEL_LOG_START_HZ / MEL_LINEAR_HZ;
    if mel < start {
        mel * MEL_LINEAR_HZ
    } else {
        MEL_LOG_START_HZ * ((mel - start) * 6.4f64.ln() / 27.0).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mel_scale_turns_back() {
        for hz in [50.0, 440.0, 999.0, 1001.0, 5000.0] {
            assert!((mel_to_hz(hz_to_mel(hz)) - hz).abs() < 1e-9 * hz);
        }
    }
}
