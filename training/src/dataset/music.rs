//! Songs on given beats, and what a live dancer hears of them.

use std::f64::consts::TAU;
use std::path::Path;

use crate::motion::tempo::smoothed;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use servodance_audio::song::{Song, SongSpec};
use servodance_audio::{AudioSource, MusicAnalyzer};
use servodance_model::conditioning::{Encodec, HeardFrame, Latent};
use servodance_model::motion::{Clip, mean_joint_speed};
use servodance_types::{FRAME_RATE_HZ, MUSIC_DIM};

use super::error::DatasetError;
use servodance_runtime::pipeline::feature_extractor::{self, FeatureExtractor};

/// Songs tried until the listener follows: to dance off the heard beat teaches to ignore it.
pub(super) const ATTEMPTS: usize = 6;
/// The least of [`followed`] that counts as following.
pub(super) const FOLLOWED: f64 = 0.75;
/// By so much music is louder where its dancer moves most than where least, decibels.
const DYNAMICS_DB: std::ops::Range<f64> = 3.0..14.0;
/// The dancer's speed is averaged over about a bar for that, seconds (one deviation).
const DYNAMICS_WITHIN_S: f64 = 0.6;

/// A song on `beats_s` that lasts `duration_s`.
pub fn on_beats(
    clip: &str,
    beats_s: &[f64],
    duration_s: f64,
    seed: u64,
) -> Result<Song, DatasetError> {
    SongSpec::on_beats(beats_s, duration_s, seed)
        .and_then(|spec| spec.render())
        .map_err(|error| music_error(clip, &error))
}

/// Makes a song loud where its dancer moves much and soft where the dancer moves little: what a
/// dancer who hears dynamics would do. The dance begins `from_s` into the song.
pub(super) fn add_dynamics(song: &mut Song, dance: &Clip, from_s: f64, rng: &mut ChaCha8Rng) {
    let range_db = rng.random_range(DYNAMICS_DB);
    let rate_hz = f64::from(song.sample_rate_hz);
    let level = smoothed(&mean_joint_speed(&dance.poses, dance.fps), DYNAMICS_WITHIN_S * dance.fps);
    let mut sorted = level.clone();
    sorted.sort_by(f64::total_cmp);
    let [low, high] =
        [0.05, 0.95].map(|share| sorted[(share * (sorted.len() - 1) as f64) as usize]);
    for (i, sample) in song.samples.iter_mut().enumerate() {
        let frame = ((i as f64 / rate_hz - from_s) * dance.fps).max(0.0);
        let at = (frame as usize).min(level.len() - 1);
        let next = (at + 1).min(level.len() - 1);
        let speed = level[at] + (level[next] - level[at]) * (frame - at as f64).clamp(0.0, 1.0);
        let share = ((speed - low) / (high - low).max(1e-6)).clamp(0.0, 1.0);
        *sample *= 10f64.powf(range_db / 20.0 * (share - 1.0)) as f32;
    }
}

/// Music vectors of `samples`, 20 a second, as heard live: `frames` after the first `skip`.
pub(super) fn hear(
    clip: &str,
    samples: &[f32],
    sample_rate_hz: u32,
    skip: usize,
    frames: usize,
) -> Result<Vec<[f32; MUSIC_DIM]>, DatasetError> {
    let mut analyzer =
        MusicAnalyzer::new(sample_rate_hz).map_err(|error| music_error(clip, &error))?;
    let mut heard = Vec::with_capacity(skip + frames);
    for block in samples.chunks(4096) {
        analyzer.push(block);
        while let Some(frame) = analyzer.pop() {
            heard.push(frame.vector());
        }
    }
    if heard.len() < skip + frames {
        return Err(music_error(
            clip,
            &format!("{} frames heard, {} needed", heard.len(), skip + frames),
        ));
    }
    heard.truncate(skip + frames);
    Ok(heard.split_off(skip))
}

/// The same frames as Encodec hears them; nothing without it.
pub(super) fn latents(
    clip: &str,
    song: &Song,
    skip: usize,
    frames: usize,
    encodec: Option<&Encodec>,
) -> Result<Option<Vec<Latent>>, DatasetError> {
    let Some(encodec) = encodec else {
        return Ok(None);
    };
    let heard = feature_extractor::latents(encodec, &song.samples, song.sample_rate_hz)
        .map_err(|error| music_error(clip, &error))?;
    match heard.get(skip..skip + frames) {
        Some(rows) => Ok(Some(rows.to_vec())),
        None => Err(music_error(
            clip,
            &format!("{} latents heard, {} needed", heard.len(), skip + frames),
        )),
    }
}

/// `frames` frames from the beginning of a recording, or as many as there are.
pub(super) fn hear_file(
    path: &Path,
    frames: usize,
    encodec: Option<&Encodec>,
) -> anyhow::Result<Vec<HeardFrame>> {
    let mut source = AudioSource::open(path)?;
    let rate_hz = source.sample_rate_hz();
    let mut ears = FeatureExtractor::new(MusicAnalyzer::new(rate_hz)?, rate_hz, encodec)?;
    let (mut heard, mut block) = (Vec::with_capacity(frames), Vec::new());
    while heard.len() < frames && source.next_block(&mut block)? {
        ears.push(&block)?;
        heard.extend(std::iter::from_fn(|| ears.pop()));
    }
    heard.truncate(frames);
    Ok(heard)
}

/// Whether the beat that was heard is the beat that was played, from 1 (always)
/// over 0 (chance) to -1 (on the off-beat). Beats that the listener was not
/// sure of do not count; fewer than half of them sure is chance.
pub(super) fn followed(music: &[[f32; MUSIC_DIM]], beats_s: &[f64]) -> f64 {
    let (mut total, mut sure) = (0.0, 0);
    let mut played = 0;
    for beat_s in beats_s {
        let frame = (beat_s * FRAME_RATE_HZ).round();
        let Some(heard) = music.get(frame as usize) else {
            continue;
        };
        played += 1;
        let [.., sin, cos, octaves, confidence] = heard.map(f64::from);
        if confidence < 0.5 {
            continue;
        }
        // The frame is a little off the beat: by so much is the phase.
        let beats_hz = 2.0 * octaves.exp2();
        let expected = TAU * (frame / FRAME_RATE_HZ - beat_s) * beats_hz;
        total += (sin.atan2(cos) - expected).cos();
        sure += 1;
    }
    if 2 * sure < played || sure == 0 { 0.0 } else { total / f64::from(sure) }
}

pub(super) fn music_error(clip: &str, error: &dyn std::fmt::Display) -> DatasetError {
    DatasetError::Music { clip: clip.to_owned(), reason: error.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn music_is_louder_where_its_dancer_moves_more() {
        // Still for ten seconds, then fast.
        let pose = |i: usize| [[0.1 * i.saturating_sub(200) as f32, 0.0, 0.0]; 22];
        let dance = Clip::of_frames((0..400).map(pose).collect());
        let beats_s: Vec<f64> = (1..40).map(|i| 0.5 * f64::from(i)).collect();
        let [plain, mut song] = [0, 1].map(|_| on_beats("test", &beats_s, 20.0, 1).unwrap());
        add_dynamics(&mut song, &dance, 0.0, &mut ChaCha8Rng::seed_from_u64(1));
        let second = song.sample_rate_hz as usize;
        let gain_db = |from_s: usize| {
            let [danced, plain] = [&song, &plain].map(|song| {
                let span = &song.samples[from_s * second..(from_s + 4) * second];
                span.iter().map(|sample| f64::from(*sample).powi(2)).sum::<f64>()
            });
            10.0 * (danced / plain).log10()
        };
        assert!(gain_db(14).abs() < 0.01, "{}", gain_db(14));
        assert!(gain_db(2) <= -DYNAMICS_DB.start, "{}", gain_db(2));
    }

    /// Music at 120 BPM whose phase is heard `off_beats` too far on.
    fn heard(off_beats: f64, confidence: f64) -> Vec<[f32; MUSIC_DIM]> {
        (0..200)
            .map(|frame| {
                let (sin, cos) = (TAU * (f64::from(frame) / 10.0 + off_beats)).sin_cos();
                let mut vector = [0.0; MUSIC_DIM];
                let beat = [sin * confidence, cos * confidence, 0.0, confidence];
                vector[MUSIC_DIM - 4..].copy_from_slice(&beat.map(|v| v as f32));
                vector
            })
            .collect()
    }

    #[test]
    fn the_off_beat_is_not_followed() {
        let beats: Vec<f64> = (0..19).map(|i| f64::from(i) * 0.5).collect();
        assert!(followed(&heard(0.0, 1.0), &beats) > 0.99);
        assert!(followed(&heard(0.5, 1.0), &beats) < -0.99);
        assert!(followed(&heard(0.25, 1.0), &beats).abs() < 0.01);
        assert_eq!(followed(&heard(0.0, 0.3), &beats), 0.0);
        // Between frames: the phase of the frame is not that of the beat.
        let between: Vec<f64> = beats.iter().map(|beat| beat + 0.02).collect();
        assert!(followed(&heard(-0.04, 1.0), &between) > 0.99);
    }
}
