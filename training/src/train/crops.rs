//! Random crops of the clips that a network learns from.

use std::ops::Range;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::data::TrainingData;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Crop {
    pub clip: usize,
    pub frames: Range<usize>,
}

/// Random crops: a clip by how often it is to be shown, a length, then a start.
#[derive(Clone, Debug)]
pub(crate) struct Crops {
    clips: Vec<usize>,
    frames: Vec<usize>,
    /// Sums of how often the clips up to each are shown.
    up_to: Vec<f64>,
    lengths: [usize; 2],
}

impl Crops {
    /// Of these clips with at least `lengths[0]` frames where that many are
    /// there, at most `lengths[1]`; clips of fewer than 2 frames are left out.
    /// `beyond` more frames are taken to follow the last of each clip.
    pub fn new(
        data: &TrainingData,
        clips: &[usize],
        shown: &[f64],
        lengths: [usize; 2],
        beyond: usize,
    ) -> Option<Self> {
        let mut crops = Self { clips: Vec::new(), frames: Vec::new(), up_to: Vec::new(), lengths };
        let mut sum = 0.0;
        for (clip, shown) in clips.iter().zip(shown) {
            let frames = data.clips[*clip].motion.len();
            if frames >= 2 && *shown > 0.0 {
                sum += shown;
                crops.clips.push(*clip);
                crops.frames.push(frames + beyond);
                crops.up_to.push(sum);
            }
        }
        (!crops.clips.is_empty()).then_some(crops)
    }

    pub fn draw(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<Crop> {
        (0..count).map(|_| self.one(rng)).collect()
    }

    fn one(&self, rng: &mut ChaCha8Rng) -> Crop {
        let total = self.up_to.last().copied().unwrap_or(1.0);
        let at = rng.random_range(0.0..total);
        let pick = self.up_to.partition_point(|sum| *sum <= at).min(self.clips.len() - 1);
        let wanted = rng.random_range(self.lengths[0]..=self.lengths[1]);
        let frames = wanted.min(self.frames[pick]);
        let start = rng.random_range(0..=self.frames[pick] - frames);
        Crop { clip: self.clips[pick], frames: start..start + frames }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::clip_entry::Split;
    use crate::train::settings::ClipWeights;
    use rand::SeedableRng;

    #[test]
    fn crops_stay_inside_their_clips_and_have_mixed_lengths() {
        let data = TrainingData::example();
        let clips: Vec<usize> = data.of_split(Split::Train).collect();
        let crops = Crops::new(
            &data,
            &clips,
            &data.sampling_weights(&clips, &ClipWeights::default()),
            [8, 64],
            0,
        )
        .unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let drawn = crops.draw(500, &mut rng);
        for crop in &drawn {
            assert!(clips.contains(&crop.clip));
            assert!(crop.frames.end <= data.clips[crop.clip].motion.len());
            assert!((8..=64).contains(&crop.frames.len()));
        }
        let lengths: std::collections::HashSet<usize> =
            drawn.iter().map(|c| c.frames.len()).collect();
        assert!(lengths.len() > 30, "{lengths:?}");
        let shown: std::collections::HashSet<usize> = drawn.iter().map(|c| c.clip).collect();
        assert_eq!(shown.len(), clips.len());
    }
}
