//! The specification of a song: tempo, style, key, sections, mix and seed.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::error::SongError;
use super::grid::{BeatGrid, Grid, TempoStep};
use super::mixer::Mix;
use super::style::Style;

/// The rate at which [`SongSpec::random`] and [`SongSpec::on_beats`] render, hertz.
pub const DEFAULT_RATE_HZ: u32 = 22_050;

/// The instruments that play.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layers {
    /// Whether kick, snare, hats, claps and hand percussion play.
    pub drums: bool,
    /// Whether the bass line plays.
    pub bass: bool,
    /// Whether the chords play.
    pub chords: bool,
    /// Whether the melody plays.
    pub lead: bool,
}

impl Layers {
    /// A section in which all instruments play.
    pub const ALL: Layers = Layers::of([true; 4]);

    /// No instrument; a section like this begins with one closing chord.
    pub const NONE: Layers = Layers::of([false; 4]);

    pub(super) const fn of([drums, bass, chords, lead]: [bool; 4]) -> Self {
        Self { drums, bass, chords, lead }
    }
}

/// A part of the song: from one bar on, these layers play.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// First bar of the section; bar 0 begins at the first downbeat.
    pub first_bar: i64,
    /// The instruments that play in it.
    pub layers: Layers,
    /// Density, 0 (sparse) to 1 (all of the pattern).
    pub intensity: f32,
}

/// Tonic and mode of a song.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MusicalKey {
    /// Pitch class of the tonic: 0 is C, 11 is B.
    pub tonic: u8,
    /// Whether the mode is minor rather than major.
    pub minor: bool,
}

/// All choices that decide the samples of a song.
#[derive(Clone, Debug, PartialEq)]
pub struct SongSpec {
    /// Sample rate of the result, hertz.
    pub sample_rate_hz: u32,
    /// Length of the result in seconds.
    pub duration_s: f64,
    /// Times of the beats.
    pub grid: Grid,
    /// Index of the beat of the grid that opens a 4/4 bar.
    pub first_downbeat: usize,
    /// Rhythm, harmony and instruments.
    pub style: Style,
    /// Tonic and mode of the harmony.
    pub key: MusicalKey,
    /// Parts of the song in order; the first one also covers what is before it.
    pub sections: Vec<Section>,
    /// Balance, room, equaliser, compression, noise floor and level.
    pub mix: Mix,
    /// Seed of the random choices: patterns, timbres, melody, small timing.
    pub seed: u64,
}

impl SongSpec {
    /// Random music whose beats are at `beats_s` (seconds; a 4/4 bar begins at
    /// the first). The grid continues at its outer tempi to fill `duration_s`.
    /// Errors: a duration or a grid outside the range of [`SongError`].
    pub fn on_beats(beats_s: &[f64], duration_s: f64, seed: u64) -> Result<SongSpec, SongError> {
        let mut spec = SongSpec::random(duration_s, seed)?;
        spec.grid = Grid::Beats(beats_s.to_vec());
        spec.beat_grid()?;
        Ok(spec)
    }

    /// Random music at a random steady tempo of its style.
    /// Errors: a duration that is not above 0 and at most an hour.
    pub fn random(duration_s: f64, seed: u64) -> Result<SongSpec, SongError> {
        check_duration(duration_s)?;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let style = Style::ALL[rng.random_range(0..Style::ALL.len())];
        let (low_bpm, high_bpm) = style.tempo_range_bpm();
        let bpm = rng.random_range(low_bpm..high_bpm);
        let beats = (duration_s * bpm / 60.0).ceil() as usize + 1;
        Ok(SongSpec {
            sample_rate_hz: DEFAULT_RATE_HZ,
            duration_s,
            grid: Grid::Tempo(vec![TempoStep { beats, bpm }]),
            first_downbeat: 0,
            style,
            key: MusicalKey { tonic: rng.random_range(0..12), minor: rng.random_bool(0.6) },
            sections: random_sections(duration_s, &mut rng),
            mix: Mix::random(&mut rng),
            seed,
        })
    }

    pub(super) fn beat_grid(&self) -> Result<BeatGrid, SongError> {
        check_duration(self.duration_s)?;
        if !(8_000..=192_000).contains(&self.sample_rate_hz) {
            return Err(SongError::SampleRate(self.sample_rate_hz));
        }
        BeatGrid::new(&self.grid, self.duration_s, self.first_downbeat)
    }

    pub(super) fn section(&self, bar: i64) -> Section {
        let before = self.sections.iter().rev().find(|s| s.first_bar <= bar);
        let section = before.or(self.sections.first()).copied();
        section.unwrap_or(Section { first_bar: 0, layers: Layers::ALL, intensity: 0.8 })
    }
}

fn check_duration(duration_s: f64) -> Result<(), SongError> {
    match duration_s > 0.0 && duration_s <= 3600.0 {
        true => Ok(()),
        false => Err(SongError::Duration(duration_s)),
    }
}

/// Sections of 4 or 8 bars with layers dropped now and then; the drums are
/// missing from few, so that most of the song has a plain beat.
fn random_sections(duration_s: f64, rng: &mut ChaCha8Rng) -> Vec<Section> {
    let has = |rng: &mut ChaCha8Rng, p: f64| rng.random_bool(p);
    let cast = Layers::of([0.95, 0.9, 0.9, 0.6].map(|p| has(rng, p)));
    let last_bar = (duration_s / 0.8) as i64;
    let mut sections = Vec::new();
    let mut first_bar = 0;
    while first_bar <= last_bar {
        let mut layers = Layers {
            drums: cast.drums && has(rng, 0.9),
            bass: cast.bass && has(rng, 0.85),
            chords: cast.chords && has(rng, 0.85),
            lead: cast.lead && has(rng, 0.7),
        };
        if !layers.drums && !layers.bass && !layers.chords {
            layers.drums = cast.drums;
            layers.chords = true;
        }
        sections.push(Section { first_bar, layers, intensity: rng.random_range(0.3..1.0) });
        first_bar += if has(rng, 0.6) { 4 } else { 8 };
    }
    sections
}
