//! Size of the motion by loudness: larger in loud bars, smaller in soft ones.
//!
//! One factor multiplies steps and the distance of the whole body from the mean pose, so that a
//! foot that stands still stands still. Causal, allocates nothing.

use super::average::Average;
use super::loudness::Loudness;
use crate::motion::representation::{CONTACTS_AT, JOINTS_AT, PoseVector, STEPS_AT};

/// Share of the newest frame in the loudness of now: two seconds, for a size that changed within
/// a beat would move the beats of the dance.
const LOUDNESS_SHARE: f32 = 0.025;
/// Share of the newest frame in the speed of now: half a second.
const SPEED_SHARE: f32 = 0.1;
/// Size added for a loudness of one usual spread above the usual.
const PER_SPREAD: f32 = 0.35;
/// A dancer who is slower than this stands, metres a frame.
const LEAST_STEP_M: f32 = 1e-3;
const SMALLEST: f32 = 0.5;
const LARGEST: f32 = 1.22;

/// Follows the loudness of the music and the speed of one dance.
#[derive(Clone, Copy, Debug)]
pub(super) struct MotionSize {
    loudness: Loudness,
    step_m: Average,
}

impl Default for MotionSize {
    fn default() -> Self {
        Self { loudness: Loudness::new(LOUDNESS_SHARE), step_m: Average::new(SPEED_SHARE) }
    }
}

impl MotionSize {
    /// The motion of a frame in the size that belongs to the loudness of its music, decibels
    /// above anything. `mean` is the pose that sizes are measured from; `strength` 0 leaves the
    /// motion as it is, 1 is the usual.
    pub fn apply(
        &mut self,
        vector: PoseVector,
        mean: &[f32],
        level_db: f32,
        strength: f32,
    ) -> PoseVector {
        self.loudness.push(level_db);
        self.step_m.push(mean_step_m(&vector));
        sized(vector, mean, self.size(strength))
    }

    fn size(&self, strength: f32) -> f32 {
        let louder = self.loudness.above_usual();
        let slower = (self.step_m.usual + LEAST_STEP_M) / (self.step_m.now + LEAST_STEP_M);
        let size = slower.powf(strength.min(1.0)) * (1.0 + PER_SPREAD * strength * louder);
        if strength > 0.0 { size.clamp(SMALLEST, LARGEST) } else { 1.0 }
    }
}

/// Turns are never smaller: the dancer would face elsewhere after them.
fn sized(mut vector: PoseVector, mean: &[f32], size: f32) -> PoseVector {
    vector[0] *= size.max(1.0);
    for step in &mut vector[1..JOINTS_AT - 1] {
        *step *= size;
    }
    for (value, mean) in vector[..STEPS_AT].iter_mut().zip(mean).skip(JOINTS_AT - 1) {
        *value = mean + (*value - mean) * size;
    }
    vector
}

/// Mean distance that a joint goes to the next frame.
fn mean_step_m(vector: &PoseVector) -> f32 {
    let steps = vector[STEPS_AT..CONTACTS_AT].chunks_exact(3);
    let joints = steps.len() as f32;
    steps.map(|step| step.iter().map(|v| v * v).sum::<f32>().sqrt()).sum::<f32>() / joints
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::representation::POSE_DIM;

    const MEAN: [f32; POSE_DIM] = [0.25; POSE_DIM];

    /// Mean distance of a wrist from its mean place for each 10 s of the loudness.
    fn sizes(loudness_db: &[f32], strength: f32) -> Vec<f32> {
        let mut size = MotionSize::default();
        let span = |db: &f32| {
            let frames = (0..200).map(|i| {
                let mut vector = MEAN;
                vector[66] += (0.5 * i as f32).sin();
                (size.apply(vector, &MEAN, *db, strength)[66] - MEAN[66]).abs()
            });
            frames.sum::<f32>() / 200.0
        };
        loudness_db.iter().map(span).collect()
    }

    #[test]
    fn loud_music_is_danced_larger_and_soft_music_smaller() {
        let [even, loud, soft] = sizes(&[-20.0, -12.0, -28.0], 1.0)[..] else { panic!() };
        assert!(loud > 1.2 * even && soft < 0.8 * even, "{even} {loud} {soft}");
    }

    #[test]
    fn strength_zero_changes_nothing() {
        let sizes = sizes(&[-20.0, 0.0, -80.0], 0.0);
        assert!(sizes.iter().all(|size| (size - sizes[0]).abs() < 1e-6), "{sizes:?}");
    }

    #[test]
    fn gain_does_not_matter() {
        let [a, b] = [[-20.0, -12.0, -28.0], [-50.0, -42.0, -58.0]].map(|db| sizes(&db, 1.0));
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-4), "{a:?} {b:?}");
    }

    #[test]
    fn a_slow_part_of_the_dance_is_made_larger_in_even_music() {
        let mut size = MotionSize::default();
        let mut last = [0.0; POSE_DIM];
        for i in 0..400 {
            let mut vector = [0.0; POSE_DIM];
            vector[STEPS_AT..CONTACTS_AT].fill(if i < 300 { 0.04 } else { 0.02 });
            vector[66] = 1.0;
            last = size.apply(vector, &[0.0; POSE_DIM], -20.0, 1.0);
        }
        assert!((1.1..=LARGEST).contains(&last[66]), "{}", last[66]);
    }
}
