//! The data of MotionSeq: motion as codes, and what is shown in place of them so
//! that generation survives its own mistakes and follows the music.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use crate::train::autodiff::parameters::normal;
use crate::train::data::TrainingData;
use crate::train::error::TrainError;
use crate::train::vqvae::codebook::LearnedCodebook;
use servodance_model::ModelError;
use servodance_model::conditioning::MusicKind;
use servodance_model::vqvae::VqEncoder;

/// A near code is one of so many nearest others.
const NEAR: usize = 8;
/// Frames by which a past can be off the beat.
const REACH: i32 = 4;
/// How likely a frame begins another offset: every second or so.
const NEW_OFFSET: f64 = 0.05;
/// Timbre and chroma among the numbers of a spectral music frame.
const DROPPED_FEATURES: std::ops::Range<usize> = 2..33;

/// Codes of every clip: [clip][part][frame].
pub(crate) type ClipCodes = Vec<Vec<Vec<u32>>>;

/// Codes of all clips; `normalise` brings a frame to standard deviations.
pub(crate) fn tokenise(
    encoder: &VqEncoder,
    data: &TrainingData,
    mean: &[f32],
    std: &[f32],
) -> Result<ClipCodes, TrainError> {
    let of_clip =
        |clip: &crate::dataset::training_file::TrainingClip| -> Result<Vec<Vec<u32>>, ModelError> {
            let normal = |row: &[f32; 137]| std::array::from_fn(|c| (row[c] - mean[c]) / std[c]);
            let motion: Vec<[f32; 137]> = clip.motion.iter().map(normal).collect();
            let rows = encoder.encode(&motion)?;
            let parts = rows.first().map_or(0, Vec::len);
            let column = |part: usize| rows.iter().map(|row| row[part] as u32).collect();
            Ok((0..parts).map(column).collect())
        };
    let codes: Result<ClipCodes, ModelError> = data.clips.par_iter().map(of_clip).collect();
    Ok(codes?)
}

pub(crate) fn neighbours(book: &LearnedCodebook) -> Vec<Vec<u32>> {
    let of_code = |code: u32| {
        let mut near = book.neighbours(book.code(code), NEAR + 1);
        near.retain(|other| *other != code);
        near
    };
    (0..book.len() as u32).map(of_code).collect()
}

/// Replaces a share of a sequence's codes: half by a near code, half by one from `elsewhere`.
pub(crate) fn corrupt(
    codes: &mut [u32],
    rate: f32,
    near: &[Vec<u32>],
    elsewhere: &[u32],
    rng: &mut ChaCha8Rng,
) {
    for code in codes {
        if rng.random::<f32>() >= rate {
            continue;
        }
        let close = &near[*code as usize];
        *code = match rng.random::<bool>() && !close.is_empty() {
            true => close[rng.random_range(0..close.len())],
            false => elsewhere[rng.random_range(0..elsewhere.len())],
        };
    }
}

/// Share of codes to replace: around twice the mean at most; now and then far more.
pub(crate) fn corruption(mean: f32, rng: &mut ChaCha8Rng) -> f32 {
    match rng.random::<f32>() < 0.15 && mean > 0.0 {
        true => rng.random_range(0.2..0.8),
        false => rng.random::<f32>() * 2.0 * mean,
    }
}

/// Frames of a past whose clock runs off the music's, early or late by some
/// frames, changing every second or so. What comes next is still due on the
/// music's time: the model learns to follow the beat it hears and not the
/// habit of the past.
pub(crate) fn jittered(
    frames: std::ops::Range<usize>,
    of_clip: usize,
    rng: &mut ChaCha8Rng,
) -> Vec<usize> {
    let mut offset = rng.random_range(-REACH..=REACH);
    frames
        .map(|frame| {
            if rng.random_bool(NEW_OFFSET) {
                offset = rng.random_range(-REACH..=REACH);
            }
            frame.saturating_add_signed(offset as isize).min(of_clip - 1)
        })
        .collect()
}

/// Hides timbre and chroma of a sequence, or blurs them: few songs are many
/// frames, and a model that can distinguish songs memorises them. Encodec latents
/// mix timbre and rhythm: they stay as they are.
pub(crate) fn drop_features(kind: MusicKind, music: &mut [f32], hide: bool, rng: &mut ChaCha8Rng) {
    let veiled = match kind {
        MusicKind::Servodance39 | MusicKind::Librosa35 => DROPPED_FEATURES,
        MusicKind::Encodec128 => 0..0,
    };
    for row in music.chunks_mut(kind.dim()) {
        for value in &mut row[veiled.clone()] {
            *value = if hide { 0.0 } else { *value + normal(rng) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn corrupted_codes_are_about_as_many_as_asked_for_and_half_of_them_near() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let book = LearnedCodebook::new((0..32).map(|i| i as f32).collect(), 1);
        let near = neighbours(&book);
        assert!(near[10].iter().all(|other| (6..=14).contains(other) && *other != 10));
        let mut codes = vec![10; 10_000];
        corrupt(&mut codes, 0.4, &near, &[31], &mut rng);
        let share =
            |what: &dyn Fn(u32) -> bool| codes.iter().filter(|c| what(**c)).count() as f64 / 1e4;
        assert!((share(&|c| c == 31) - 0.2).abs() < 0.02);
        assert!((share(&|c| c != 31 && c != 10) - 0.2).abs() < 0.02);
    }

    #[test]
    fn a_shaken_past_stays_in_its_clip_and_near_its_time() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let frames = jittered(0..200, 198, &mut rng);
        for (i, frame) in frames.iter().enumerate() {
            assert!(*frame < 198 && frame.abs_diff(i) <= 5);
        }
        assert!(frames.iter().enumerate().any(|(i, f)| *f != i));
    }

    #[test]
    fn the_veil_leaves_energy_and_beat() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let kind = MusicKind::default();
        let mut music = vec![0.5; 2 * kind.dim()];
        drop_features(kind, &mut music, true, &mut rng);
        assert_eq!((music[0], music[2], music[32], music[33]), (0.5, 0.0, 0.0, 0.5));
        drop_features(kind, &mut music, false, &mut rng);
        assert!(music[kind.dim() + 5] != 0.0 && music[38] == 0.5);
    }
}
