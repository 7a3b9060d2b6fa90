//! Songs rendered by code: nobody's rights are touched, and every beat is known.
//!
//! A [`SongSpec`] says what to play; [`SongSpec::render`] plays it into a
//! [`Song`]: mono samples in -1..1 at `sample_rate_hz`, with the times of the
//! beats in seconds. The same spec gives the same samples on the same machine.
//! Rendering is for tests, training data and the built-in song, not for the
//! audio thread: it allocates the whole song.
//!
//! Refused: beat times that do not increase or lie outside 30-300 BPM, an
//! empty or endless duration, a sample rate below 8 kHz.

mod arrange;
mod demo;
mod drums;
mod grid;
mod mix;
mod style;
mod voice;

use rand::Rng;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

pub use grid::{Grid, TempoStep};
pub use mix::Mix;
pub use style::Style;

use grid::BeatGrid;

/// The rate at which [`SongSpec::random`] and [`SongSpec::on_beats`] render.
pub const DEFAULT_RATE_HZ: u32 = 22_050;

/// Why a song cannot be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SongError {
    /// The duration is not a length of time that a song can have.
    #[error("a song lasts above 0 and at most 3600 seconds, not {0}")]
    Duration(f64),
    /// The sample rate cannot carry music.
    #[error("the sample rate must be 8000 to 192000 Hz, not {0}")]
    SampleRate(u32),
    /// A grid needs at least two beats to have a tempo.
    #[error("a beat grid needs at least 2 beats, not {0}")]
    TooFewBeats(usize),
    /// Two neighbouring beats are not a musical distance apart.
    #[error("beat {index} comes {interval_s:.3} s after the one before; 0.2 to 2 s are allowed")]
    Interval {
        /// Index of the later beat.
        index: usize,
        /// Seconds between the two.
        interval_s: f64,
    },
}

/// Which instruments play.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layers {
    /// Kick, snare, hats, claps and hand percussion.
    pub drums: bool,
    /// The bass line.
    pub bass: bool,
    /// The harmony.
    pub chords: bool,
    /// The melody.
    pub lead: bool,
}

impl Layers {
    /// Everybody plays.
    pub const ALL: Layers = Layers {
        drums: true,
        bass: true,
        chords: true,
        lead: true,
    };

    /// Nobody plays; a section like this begins with one closing chord.
    pub const NONE: Layers = Layers {
        drums: false,
        bass: false,
        chords: false,
        lead: false,
    };
}

/// A part of the song: from one bar on, these layers play.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// First bar of the section, counted from the first downbeat; bars before
    /// it are negative.
    pub first_bar: i64,
    /// Who plays.
    pub layers: Layers,
    /// How busy it is, 0 (sparse) to 1 (everything).
    pub intensity: f32,
}

/// Tonic and mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// Pitch class of the tonic: 0 is C, 11 is B.
    pub tonic: u8,
    /// Minor rather than major.
    pub minor: bool,
}

/// Everything that decides how a song sounds.
#[derive(Clone, Debug, PartialEq)]
pub struct SongSpec {
    /// Samples a second of the result.
    pub sample_rate_hz: u32,
    /// Length of the result in seconds.
    pub duration_s: f64,
    /// Where the beats are.
    pub grid: Grid,
    /// Which beat of the grid is the first one of a 4/4 bar.
    pub first_downbeat: usize,
    /// Rhythm, harmony and instruments.
    pub style: Style,
    /// Tonic and mode.
    pub key: Key,
    /// Parts of the song in order; the first one also covers what is before it.
    pub sections: Vec<Section>,
    /// Balance, room, equaliser, compression, noise floor and level.
    pub mix: Mix,
    /// Decides every free choice: patterns, timbres, melody, small timing.
    pub seed: u64,
}

/// A rendered song and its truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Song {
    /// Samples a second.
    pub sample_rate_hz: u32,
    /// Mono samples, -1 to 1.
    pub samples: Vec<f32>,
    /// Times of all beats in the song, seconds, increasing.
    pub beats_s: Vec<f64>,
    /// Indices into `beats_s` of the first beats of the bars.
    pub downbeats: Vec<usize>,
}

impl SongSpec {
    /// Random music whose beats are at `beats_s` (seconds; a 4/4 bar begins at
    /// the first). The grid goes on at its outer tempi to fill `duration_s`.
    pub fn on_beats(beats_s: &[f64], duration_s: f64, seed: u64) -> Result<SongSpec, SongError> {
        let mut spec = SongSpec::random(duration_s, seed)?;
        spec.grid = Grid::Beats(beats_s.to_vec());
        BeatGrid::new(&spec)?;
        Ok(spec)
    }

    /// Random music at a random steady tempo of its style.
    pub fn random(duration_s: f64, seed: u64) -> Result<SongSpec, SongError> {
        if !(duration_s > 0.0 && duration_s <= 3600.0) {
            return Err(SongError::Duration(duration_s));
        }
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
            key: Key {
                tonic: rng.random_range(0..12),
                minor: rng.random_bool(0.6),
            },
            sections: random_sections(duration_s, &mut rng),
            mix: Mix::random(&mut rng),
            seed,
        })
    }

    /// Plays the song.
    pub fn render(&self) -> Result<Song, SongError> {
        let grid = BeatGrid::new(self)?;
        let length = (self.duration_s * f64::from(self.sample_rate_hz)).round() as usize;
        let buses = arrange::play(self, &grid, length);
        let samples = mix::master(&self.mix, self.sample_rate_hz as f32, buses, self.seed);
        let (beats_s, downbeats) = grid.truth(self.duration_s);
        Ok(Song {
            sample_rate_hz: self.sample_rate_hz,
            samples,
            beats_s,
            downbeats,
        })
    }

    /// The section that `bar` lies in.
    fn section(&self, bar: i64) -> Section {
        let before = self.sections.iter().rev().find(|s| s.first_bar <= bar);
        before
            .or(self.sections.first())
            .copied()
            .unwrap_or(Section {
                first_bar: 0,
                layers: Layers::ALL,
                intensity: 0.8,
            })
    }
}

impl Song {
    /// The built-in song: about 40 s with an intro, a groove, a break, a rise
    /// from 112 to 126 BPM and an end.
    pub fn demo() -> Song {
        demo::render()
    }

    /// Length in seconds.
    pub fn duration_s(&self) -> f64 {
        self.samples.len() as f64 / f64::from(self.sample_rate_hz)
    }
}

/// Sections of 4 or 8 bars with layers dropped now and then; the drums are
/// missing from few, so that most of the song has a plain beat.
fn random_sections(duration_s: f64, rng: &mut ChaCha8Rng) -> Vec<Section> {
    let has = |rng: &mut ChaCha8Rng, p: f64| rng.random_bool(p);
    let cast = Layers {
        drums: has(rng, 0.95),
        bass: has(rng, 0.9),
        chords: has(rng, 0.9),
        lead: has(rng, 0.6),
    };
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
        sections.push(Section {
            first_bar,
            layers,
            intensity: rng.random_range(0.3..1.0),
        });
        first_bar += if has(rng, 0.6) { 4 } else { 8 };
    }
    sections
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rms(samples: &[f32]) -> f32 {
        (samples.iter().map(|s| s * s).sum::<f32>() / samples.len() as f32).sqrt()
    }

    #[test]
    fn same_seed_gives_same_samples() {
        let song = |seed| SongSpec::random(6.0, seed).unwrap().render().unwrap();
        assert_eq!(song(7), song(7));
        assert_ne!(song(7).samples, song(8).samples);
    }

    #[test]
    fn every_style_sounds_and_stays_in_range() {
        for style in Style::ALL {
            let mut spec = SongSpec::random(5.0, 3).unwrap();
            spec.style = style;
            let song = spec.render().unwrap();
            assert_eq!(song.samples.len(), 5 * DEFAULT_RATE_HZ as usize);
            assert!(song.samples.iter().all(|s| s.abs() <= 1.0), "{style:?}");
            assert!(rms(&song.samples) > 1e-3, "{style:?} is silent");
        }
    }

    #[test]
    fn beats_given_are_beats_heard() {
        let beats_s: Vec<f64> = (0..16).map(|i| 0.31 + 0.5 * f64::from(i)).collect();
        let mut spec = SongSpec::on_beats(&beats_s, 8.5, 5).unwrap();
        spec.style = Style::House;
        spec.mix = Mix::clean();
        spec.sections = vec![Section {
            first_bar: 0,
            layers: Layers {
                bass: false,
                chords: false,
                lead: false,
                drums: true,
            },
            intensity: 0.0,
        }];
        let song = spec.render().unwrap();
        for beat in &beats_s {
            assert!(song.beats_s.iter().any(|b| (b - beat).abs() < 1e-9));
            let at = (beat * f64::from(song.sample_rate_hz)) as usize;
            let (before, after) = (&song.samples[at - 220..at - 1], &song.samples[at..at + 220]);
            assert!(
                rms(after) > 4.0 * rms(before),
                "no onset at {beat} s: {} then {}",
                rms(before),
                rms(after)
            );
        }
    }

    #[test]
    fn demo_rises_from_112_to_126_bpm() {
        let song = Song::demo();
        let interval = |i: usize| song.beats_s[i + 1] - song.beats_s[i];
        assert!((60.0 / interval(0) - 112.0).abs() < 1e-6);
        assert!((60.0 / interval(song.beats_s.len() - 2) - 126.0).abs() < 1e-6);
        assert!(
            (36.0..44.0).contains(&song.duration_s()),
            "{}",
            song.duration_s()
        );
        assert_eq!(song.downbeats[..3], [0, 4, 8]);
    }

    #[test]
    fn unusable_specs_are_refused() {
        assert_eq!(
            SongSpec::random(f64::NAN, 0).unwrap_err().to_string(),
            "a song lasts above 0 and at most 3600 seconds, not NaN"
        );
        assert_eq!(
            SongSpec::on_beats(&[1.0], 4.0, 0),
            Err(SongError::TooFewBeats(1))
        );
        assert!(matches!(
            SongSpec::on_beats(&[1.0, 1.5, 1.4], 4.0, 0),
            Err(SongError::Interval { index: 2, .. })
        ));
        assert!(SongSpec::on_beats(&[0.0, f64::NAN], 4.0, 0).is_err());
        let mut spec = SongSpec::random(1.0, 0).unwrap();
        spec.sample_rate_hz = 100;
        assert_eq!(spec.render(), Err(SongError::SampleRate(100)));
    }
}
