//! How fast each body part moves in each of its codes, as the decoder says.

use crate::config::{ModelConfig, part_channels};
use crate::error::ModelError;
use crate::motion::representation::{CONTACTS_AT, PoseVector, STEPS_AT};

/// Slower than this counts as standing, metres a frame.
const LEAST_STEP_M: f32 = 2e-3;
/// Codes whose logarithms of speed differ less are equally fast.
const LEAST_DEVIATION: f32 = 1e-4;
/// No code is further from the mean of its part, in standard deviations.
const FURTHEST: f32 = 2.5;

/// For each part and code the logarithm of the speed, as a standard score among the codes of the
/// part: 0 is the mean, positive is faster.
#[derive(Clone, Debug, Default)]
pub(super) struct CodeSpeeds(Vec<Vec<f32>>);

impl CodeSpeeds {
    /// Decodes every code once, as the first of a motion and in all parts together: attention
    /// over the same code again would give the same speed. `decode_first` makes the motion of a
    /// first frame out of its codes.
    pub fn measure(
        config: &ModelConfig,
        mut decode_first: impl FnMut(&[usize]) -> Result<PoseVector, ModelError>,
    ) -> Result<Self, ModelError> {
        let channels: Vec<Vec<usize>> = config.parts.iter().map(|part| steps_of(part)).collect();
        let mut speeds = vec![Vec::with_capacity(config.codes); config.parts.len()];
        let mut row = vec![0; config.codes_a_frame()];
        for code in 0..config.codes {
            row[..config.parts.len()].fill(code);
            let vector = decode_first(&row)?;
            for (speeds, channels) in speeds.iter_mut().zip(&channels) {
                speeds.push((mean_step_m(&vector, channels) + LEAST_STEP_M).ln());
            }
        }
        speeds.iter_mut().for_each(|part| standardise(part));
        Ok(Self(speeds))
    }

    /// Of one part, a number for each code; none where they were not measured.
    pub fn of(&self, part: usize) -> &[f32] {
        self.0.get(part).map_or(&[], Vec::as_slice)
    }
}

/// The numbers of a frame that say how far the joints of a part go, three for each.
fn steps_of(part: &str) -> Vec<usize> {
    let channels = part_channels(part).unwrap_or_default();
    channels.into_iter().filter(|channel| (STEPS_AT..CONTACTS_AT).contains(channel)).collect()
}

fn mean_step_m(vector: &PoseVector, channels: &[usize]) -> f32 {
    let steps = channels.chunks_exact(3);
    let joints = steps.len().max(1) as f32;
    let length = |step: &[usize]| step.iter().map(|&c| vector[c].powi(2)).sum::<f32>().sqrt();
    steps.map(length).sum::<f32>() / joints
}

/// Leaves zeros where the numbers are not finite or all the same.
fn standardise(values: &mut [f32]) {
    let n = values.len() as f32;
    let mean = values.iter().sum::<f32>() / n;
    let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / n).sqrt();
    let is_known = deviation.is_finite() && deviation > LEAST_DEVIATION;
    for value in values {
        let score = (*value - mean) / deviation;
        *value = if is_known { score.clamp(-FURTHEST, FURTHEST) } else { 0.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::representation::POSE_DIM;

    #[test]
    fn a_code_that_moves_further_is_faster_in_the_parts_that_move() {
        let config = ModelConfig {
            parts: vec!["left_arm".into(), "right_arm".into()],
            codes: 3,
            levels: Vec::new(),
            ..ModelConfig::preset("tiny").unwrap()
        };
        // The left wrist, joint 20, goes 1 cm a frame further with each code.
        let decode = |row: &[usize]| {
            let mut vector = [0.0; POSE_DIM];
            vector[STEPS_AT + 60] = 0.01 * row[0] as f32;
            Ok(vector)
        };
        let speeds = CodeSpeeds::measure(&config, decode).unwrap();
        assert!(speeds.of(0).is_sorted() && speeds.of(0)[2] > 0.5, "{speeds:?}");
        assert_eq!(speeds.of(1), [0.0; 3]);
    }

    #[test]
    fn speeds_that_say_nothing_count_as_zero() {
        for mut values in [vec![0.25; 8], vec![1.0, f32::NAN, 2.0]] {
            standardise(&mut values);
            assert!(values.iter().all(|v| *v == 0.0), "{values:?}");
        }
    }
}
