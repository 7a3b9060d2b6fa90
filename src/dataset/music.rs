//! Songs on given beats, and what a live dancer hears of them.

use servodance_audio::MusicAnalyzer;
use servodance_audio::song::{Song, SongSpec};
use servodance_types::MUSIC_DIM;

use super::DatasetError;

/// A song on `beats_s` that lasts `duration_s`.
pub(super) fn on_beats(
    clip: &str,
    beats_s: &[f64],
    duration_s: f64,
    seed: u64,
) -> Result<Song, DatasetError> {
    SongSpec::on_beats(beats_s, duration_s, seed)
        .and_then(|spec| spec.render())
        .map_err(|error| music_error(clip, &error))
}

/// The music vectors of `samples`, 20 a second, as heard live: `frames` of
/// them after the first `skip`.
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

pub(super) fn music_error(clip: &str, error: &dyn std::fmt::Display) -> DatasetError {
    DatasetError::Music {
        clip: clip.to_owned(),
        reason: error.to_string(),
    }
}
