//! The training file in memory.

use std::ops::Range;
use std::path::Path;

use sha2::{Digest, Sha256};

use super::error::TrainError;
use super::settings::ClipWeights;
use crate::dataset::clip_entry::Split;
use crate::dataset::styles::{self, STYLES};
use crate::dataset::training_file::{self, TrainingClip};
use servodance_model::conditioning::MusicKind;
use servodance_model::motion::representation::{CONTACTS_AT, JOINTS_AT, POSE_DIM, STEPS_AT};

/// Longest that a clip counts by its length, frames.
const COUNTED_FRAMES: usize = 4000;
/// What normalised spectral features are clamped to, as in the generator.
const MUSIC_CLAMP: f32 = 6.0;
/// Numbers that share one scale: yaw step, root step, root height, positions, velocities, contacts.
const GROUPS: [Range<usize>; 6] = [
    0..1,
    1..JOINTS_AT - 1,
    JOINTS_AT - 1..JOINTS_AT,
    JOINTS_AT..STEPS_AT,
    STEPS_AT..CONTACTS_AT,
    CONTACTS_AT..POSE_DIM,
];

/// The clips of a training file, and the hash that checkpoints remember.
#[derive(Clone, Debug)]
pub struct TrainingData {
    pub(crate) clips: Vec<TrainingClip>,
    /// SHA-256 of the file, in hexadecimal.
    pub(crate) sha256: String,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Normalisation {
    pub mean: Vec<f32>,
    pub std: Vec<f32>,
}

impl TrainingData {
    /// Reads what `dataset build` wrote. Fails where no clips train.
    pub fn read(path: &Path) -> Result<Self, TrainError> {
        let clips = training_file::read(path)?;
        let bytes = std::fs::read(path)
            .map_err(|e| TrainError::Settings(format!("{}: {e}", path.display())))?;
        let data = Self { clips, sha256: sha256(&bytes) };
        if data.of_split(Split::Train).next().is_none() {
            let message = format!("{}: no clips of the split `train`", path.display());
            return Err(TrainError::Settings(message));
        }
        Ok(data)
    }

    pub(crate) fn of_split(&self, split: Split) -> impl Iterator<Item = usize> + '_ {
        (0..self.clips.len()).filter(move |c| self.clips[*c].split == split)
    }

    /// Statistics of the training motion; the deviation is averaged within each group, as HumanML3D does.
    pub(crate) fn motion_norm(&self) -> Normalisation {
        let rows = self.of_split(Split::Train).flat_map(|c| &self.clips[c].motion);
        let rows: Vec<&[f32]> = rows.map(|row| &row[..]).collect();
        let mut norm = moments(&rows, POSE_DIM, 1e-4);
        for group in GROUPS {
            let wide = group.len() as f32;
            let even = norm.std[group.clone()].iter().sum::<f32>() / wide;
            norm.std[group].fill(even);
        }
        norm
    }

    /// Statistics of the training music; the numbers of the beat stay as they are.
    pub(crate) fn music_norm(&self, kind: MusicKind) -> Normalisation {
        let clips = self.of_split(Split::Train).map(|c| &self.clips[c]);
        let rows =
            clips.flat_map(|clip| (0..clip.motion.len()).filter_map(|f| clip.music_row(kind, f)));
        let mut norm = moments(&rows.collect::<Vec<_>>(), kind.dim(), 1e-3);
        norm.mean[kind.measured()..].fill(0.0);
        norm.std[kind.measured()..].fill(1.0);
        norm
    }

    /// Refuses a file in which music is not known as this kind of numbers.
    pub(crate) fn check_music(&self, kind: MusicKind) -> Result<(), TrainError> {
        let unknown =
            |clip: &&TrainingClip| clip.music.is_some() && clip.music_row(kind, 0).is_none();
        match self.clips.iter().find(unknown) {
            None => Ok(()),
            Some(clip) => Err(TrainError::Settings(format!(
                "model.music is {}, but the training file knows clip {} as {} only: build it \
                 with `servodance dataset build --music-features {}`",
                kind.name(),
                clip.name,
                MusicKind::default().name(),
                kind.name()
            ))),
        }
    }

    /// Names of the styles that weights trained on these clips know.
    pub(crate) fn styles(&self) -> Vec<String> {
        let named = styles::named(self.clips.iter().map(|clip| clip.style));
        named.iter().map(|name| (*name).to_owned()).collect()
    }

    pub(crate) fn most_common_style(&self) -> usize {
        let mut frames = [0; STYLES.len()];
        for c in self.of_split(Split::Train) {
            let clip = &self.clips[c];
            let counts = clip.dance && clip.music.is_some();
            frames[clip.style] += if counts { clip.motion.len() } else { 0 };
        }
        let most = (0..STYLES.len()).rev().max_by_key(|style| frames[*style]);
        most.unwrap_or(0)
    }

    /// How often each clip of a list is to be shown: weight times length.
    pub(crate) fn sampling_weights(&self, clips: &[usize], weights: &ClipWeights) -> Vec<f64> {
        let of_clip = |c: &usize| {
            let clip = &self.clips[*c];
            let kind = match (clip.synthetic, clip.dance) {
                (true, _) => weights.synthetic,
                (false, true) => 1.0,
                (false, false) => weights.other,
            };
            kind * if clip.music.is_some() { 1.0 } else { weights.silent }
        };
        let base: Vec<f64> = clips.iter().map(of_clip).collect();
        let mut of_style = vec![0.0; STYLES.len()];
        for (c, weight) in clips.iter().zip(&base) {
            of_style[self.clips[*c].style] += weight * self.clips[*c].motion.len() as f64;
        }
        let shown = clips.iter().zip(&base).map(|(c, weight)| {
            let clip = &self.clips[*c];
            let balance = of_style[clip.style].max(f64::MIN_POSITIVE).powf(-weights.balance);
            weight * balance * clip.motion.len().min(COUNTED_FRAMES) as f64
        });
        shown.collect()
    }
}

/// In hexadecimal.
pub(super) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
}

impl Normalisation {
    /// Music of this kind as MotionSeq is trained on it.
    pub fn music<'a>(&'a self, kind: MusicKind, row: &'a [f32]) -> impl Iterator<Item = f32> + 'a {
        let normal = |i: usize| (row[i] - self.mean[i]) / self.std[i];
        (0..kind.dim()).map(move |i| match i < kind.measured() {
            true => normal(i).clamp(-MUSIC_CLAMP, MUSIC_CLAMP),
            false => normal(i),
        })
    }
}

/// Mean and deviation (at least `floor`) of every column.
fn moments(rows: &[&[f32]], columns: usize, floor: f64) -> Normalisation {
    let (mut sums, count) = (vec![0.0f64; columns], rows.len() as f64);
    for row in rows {
        sums.iter_mut().zip(*row).for_each(|(s, v)| *s += f64::from(*v));
    }
    let mean: Vec<f64> = sums.iter().map(|s| s / count.max(1.0)).collect();
    let mut squares = vec![0.0f64; columns];
    for row in rows {
        for ((s, v), m) in squares.iter_mut().zip(*row).zip(&mean) {
            *s += (f64::from(*v) - m).powi(2);
        }
    }
    let deviation = |s: &f64| (s / (count - 1.0).max(1.0)).sqrt().max(floor) as f32;
    Normalisation {
        std: squares.iter().map(deviation).collect(),
        mean: mean.iter().map(|m| *m as f32).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_model::conditioning::LATENT_DIM;
    use servodance_types::MUSIC_DIM;

    /// A clip of smooth motion and music that only its number decides.
    fn clip(number: usize, frames: usize, split: Split) -> TrainingClip {
        let wave =
            |t: usize, c: usize| ((t as f32 * 0.3 + (c * 7 + number * 3) as f32) * 0.7).sin();
        TrainingClip {
            name: format!("clip {number}"),
            motion: (0..frames).map(|t| std::array::from_fn(|c| 0.1 * wave(t, c))).collect(),
            music: number
                .is_multiple_of(2)
                .then(|| (0..frames).map(|t| std::array::from_fn(|c| wave(t, c + 5))).collect()),
            latents: None,
            style: number % STYLES.len(),
            split,
            dance: true,
            synthetic: number.is_multiple_of(3),
            variant: 0,
        }
    }

    impl TrainingData {
        /// Eight clips, two of them for validation.
        pub fn example() -> Self {
            let split = |n: usize| {
                if n % 4 == 2 { Split::Validation } else { Split::Train }
            };
            Self {
                clips: (0..8).map(|n| clip(n, 40 + 13 * n, split(n))).collect(),
                sha256: "test".into(),
            }
        }
    }

    #[test]
    fn groups_share_their_deviation_and_the_beat_stays_as_it_is() {
        let data = TrainingData::example();
        let norm = data.motion_norm();
        assert!(norm.std[STEPS_AT..CONTACTS_AT].windows(2).all(|pair| pair[0] == pair[1]));
        let kind = MusicKind::default();
        let music = data.music_norm(kind);
        assert_eq!(music.mean[kind.measured()..], [0.0; 4]);
        let row = [100.0; MUSIC_DIM];
        let normal: Vec<f32> = music.music(kind, &row).collect();
        assert_eq!((normal[3], normal[36]), (6.0, 100.0));
    }

    #[test]
    fn music_that_encodec_did_not_hear_is_refused() {
        let mut data = TrainingData::example();
        assert!(data.check_music(MusicKind::Librosa35).is_ok());
        let error = data.check_music(MusicKind::Encodec128).unwrap_err();
        let message = error.to_string();
        assert!(message.contains("clip 0") && message.contains("encodec128"), "{message}");
        for clip in &mut data.clips {
            let heard = |music: &Vec<_>| vec![[0.5; LATENT_DIM]; music.len()];
            clip.latents = clip.music.as_ref().map(heard);
        }
        data.check_music(MusicKind::Encodec128).unwrap();
        assert_eq!(data.music_norm(MusicKind::Encodec128).mean, [0.5; LATENT_DIM]);
    }
}
