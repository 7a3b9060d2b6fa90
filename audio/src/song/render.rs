//! From a specification to samples.

use super::arrangement::play;
use super::error::SongError;
use super::mixer::master;
use super::spec::SongSpec;

/// A rendered song and its true beats.
#[derive(Clone, Debug, PartialEq)]
pub struct Song {
    /// Sample rate of the song, hertz.
    pub sample_rate_hz: u32,
    /// Mono samples in the range -1 to 1.
    pub samples: Vec<f32>,
    /// Times of all beats in the song, seconds, increasing.
    pub beats_s: Vec<f64>,
    /// Indices into `beats_s` of the first beats of the bars.
    pub downbeats: Vec<usize>,
}

impl SongSpec {
    /// Renders the song; the same specification gives the same samples.
    /// Errors: a duration, a sample rate or a grid outside the range of [`SongError`].
    pub fn render(&self) -> Result<Song, SongError> {
        let grid = self.beat_grid()?;
        let length = (self.duration_s * f64::from(self.sample_rate_hz)).round() as usize;
        let buses = play(self, &grid, length);
        let samples = master(&self.mix, self.sample_rate_hz as f32, buses, self.seed);
        let (beats_s, downbeats) = grid.truth(self.duration_s);
        Ok(Song { sample_rate_hz: self.sample_rate_hz, samples, beats_s, downbeats })
    }
}

impl Song {
    /// Length of the samples in seconds.
    pub fn duration_s(&self) -> f64 {
        self.samples.len() as f64 / f64::from(self.sample_rate_hz)
    }
}
