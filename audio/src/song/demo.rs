//! The built-in song: nu-disco in A minor, intro, groove, break, faster, end.

use super::grid::{Grid, TempoStep};
use super::mixer::Mix;
use super::render::Song;
use super::spec::{Layers, MusicalKey, Section, SongSpec};
use super::style::Style;

const INTRO_BARS: usize = 3;
const GROOVE_BARS: usize = 6;
const BREAK_BARS: usize = 2;
const FAST_BARS: usize = 7;
const SLOW_BPM: f64 = 112.0;
const FAST_BPM: f64 = 126.0;

impl Song {
    /// The built-in song: about 40 s with an intro, a groove, a break, a rise
    /// from 112 to 126 BPM and an end.
    pub fn demo() -> Song {
        // The specification is constant, and a test renders it.
        spec().render().unwrap_or(Song {
            sample_rate_hz: 44_100,
            samples: Vec::new(),
            beats_s: Vec::new(),
            downbeats: Vec::new(),
        })
    }
}

fn spec() -> SongSpec {
    let slow_beats = 4 * (INTRO_BARS + GROOVE_BARS + BREAK_BARS);
    let fast_beats = 4 * (FAST_BARS + 1);
    let seconds = slow_beats as f64 * 60.0 / SLOW_BPM + fast_beats as f64 * 60.0 / FAST_BPM;
    let step = |beats, bpm| TempoStep { beats, bpm };
    let pause = INTRO_BARS + GROOVE_BARS;
    let fast = pause + BREAK_BARS;
    // First bar; drums, bass, chords, lead; intensity.
    let sections = [
        (0, [true, false, true, false], 0.4),
        (INTRO_BARS, [true, true, true, false], 0.6),
        (INTRO_BARS + 2, [true; 4], 0.8),
        (pause, [false, false, true, true], 0.4),
        (fast, [true; 4], 0.9),
        (fast + FAST_BARS, [false; 4], 0.0),
    ];
    let section = |(first_bar, layers, intensity)| Section {
        first_bar: first_bar as i64,
        layers: Layers::of(layers),
        intensity,
    };
    SongSpec {
        sample_rate_hz: 44_100,
        duration_s: seconds,
        grid: Grid::Tempo(vec![step(slow_beats, SLOW_BPM), step(fast_beats, FAST_BPM)]),
        first_downbeat: 0,
        style: Style::Disco,
        key: MusicalKey { tonic: 9, minor: true },
        sections: sections.map(section).into(),
        mix: Mix::demo(),
        seed: 2,
    }
}
