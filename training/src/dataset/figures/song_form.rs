//! A rendered song with what there is to answer in it: bars, how loud they are, sections,
//! breaks.

use super::super::error::DatasetError;
use super::super::music::{hear, music_error};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use servodance_audio::song::{Grid, Song, SongSpec, TempoStep};
use servodance_types::MUSIC_DIM;

/// How much faster or slower than the figures usually are, at most.
const STRETCH: (f64, f64) = (0.85, 1.18);
/// Tempi that are rendered, seconds a beat.
const PERIODS_S: (f64, f64) = (0.34, 0.85);
/// A section is so likely to end in a bar of silence.
const BREAKS: f64 = 0.25;
const FADE_S: f64 = 0.06;
const BEATS_IN_BAR: usize = 4;
/// Softer than this is silence, decibels.
const SILENCE_DB: f64 = -70.0;

pub struct SongForm {
    pub song: Song,
    pub bars: Vec<Bar>,
}

/// A bar of four beats.
#[derive(Clone, Copy, Debug)]
pub struct Bar {
    /// Its first beat, a number into the song's beats.
    pub beat: usize,
    /// How loud it is among the bars of the song, 0 to 1.
    pub loudness: f64,
    pub begins_section: bool,
    pub is_break: bool,
}

impl SongForm {
    /// A song of about the period of beats.
    pub fn random(
        name: &str,
        duration_s: f64,
        period_s: f64,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, DatasetError> {
        let error = |error| music_error(name, &error);
        let mut spec = SongSpec::random(duration_s + 0.2, rng.random()).map_err(error)?;
        let period_s =
            (period_s * rng.random_range(STRETCH.0..STRETCH.1)).clamp(PERIODS_S.0, PERIODS_S.1);
        let beats = (duration_s / period_s).ceil() as usize + 1;
        spec.grid = Grid::Tempo(vec![TempoStep { beats, bpm: 60.0 / period_s }]);
        let mut song = spec.render().map_err(error)?;
        let sections: Vec<usize> =
            spec.sections.iter().filter_map(|s| usize::try_from(s.first_bar).ok()).collect();
        let count = song.beats_s.len() / BEATS_IN_BAR;
        let mut bars: Vec<Bar> = (0..count)
            .map(|bar| Bar {
                beat: song.downbeats.first().copied().unwrap_or(0) + bar * BEATS_IN_BAR,
                loudness: 0.5,
                begins_section: sections.contains(&bar),
                is_break: sections.contains(&(bar + 1)) && bar > 0 && rng.random_bool(BREAKS),
            })
            .filter(|bar| bar.beat + BEATS_IN_BAR < song.beats_s.len())
            .collect();
        for bar in bars.iter().filter(|bar| bar.is_break) {
            silence(&mut song, bar.beat);
        }
        let levels: Vec<f64> = bars.iter().map(|bar| level_db(&song, bar.beat)).collect();
        let heard = || levels.iter().copied().filter(|level| *level > SILENCE_DB);
        let (low, high) = (heard().fold(0.0, f64::min), heard().fold(SILENCE_DB, f64::max));
        for (bar, level) in bars.iter_mut().zip(&levels) {
            // Music without dynamics is danced as one.
            bar.loudness = match high - low > 1.0 {
                true => ((level - low) / (high - low)).clamp(0.0, 1.0),
                false => 0.6,
            };
        }
        Ok(Self { song, bars })
    }

    /// Beats outside of breaks, seconds.
    pub fn audible_beats_s(&self) -> Vec<f64> {
        let silent = |beat: usize| {
            let of =
                |bar: &Bar| bar.is_break && (bar.beat..bar.beat + BEATS_IN_BAR).contains(&beat);
            self.bars.iter().any(of)
        };
        let beats = self.song.beats_s.iter().enumerate();
        beats.filter(|(beat, _)| !silent(*beat)).map(|(_, time_s)| *time_s).collect()
    }

    /// What a live dancer hears of it.
    pub fn hear(&self, name: &str, frames: usize) -> Result<Vec<[f32; MUSIC_DIM]>, DatasetError> {
        hear(name, &self.song.samples, self.song.sample_rate_hz, 0, frames)
    }
}

fn samples_of_bar(song: &Song, beat: usize) -> std::ops::Range<usize> {
    let at = |beat: usize| {
        ((song.beats_s[beat] * f64::from(song.sample_rate_hz)) as usize).min(song.samples.len())
    };
    at(beat)..at(beat + BEATS_IN_BAR)
}

fn silence(song: &mut Song, beat: usize) {
    let samples = samples_of_bar(song, beat);
    let fade = FADE_S * f64::from(song.sample_rate_hz);
    let last = samples.len();
    for (i, sample) in song.samples[samples].iter_mut().enumerate() {
        let inside = (i.min(last - i) as f64 / fade).min(1.0);
        *sample *= (1.0 - inside) as f32;
    }
}

fn level_db(song: &Song, beat: usize) -> f64 {
    let samples = &song.samples[samples_of_bar(song, beat)];
    let squares: f64 = samples.iter().map(|s| f64::from(*s).powi(2)).sum();
    (10.0 * (squares / samples.len().max(1) as f64).log10()).max(SILENCE_DB)
}
