//! The built-in song: nu-disco in A minor, intro, groove, break, faster, end.

use super::{Grid, Key, Layers, Mix, Section, Song, SongSpec, Style, TempoStep};

const INTRO_BARS: usize = 3;
const GROOVE_BARS: usize = 6;
const BREAK_BARS: usize = 2;
const FAST_BARS: usize = 7;
const SLOW_BPM: f64 = 112.0;
const FAST_BPM: f64 = 126.0;

fn section(first_bar: usize, layers: Layers, intensity: f32) -> Section {
    Section {
        first_bar: first_bar as i64,
        layers,
        intensity,
    }
}

/// What the demo plays.
pub(super) fn spec() -> SongSpec {
    let slow_beats = 4 * (INTRO_BARS + GROOVE_BARS + BREAK_BARS);
    let fast_beats = 4 * (FAST_BARS + 1);
    let seconds = slow_beats as f64 * 60.0 / SLOW_BPM + fast_beats as f64 * 60.0 / FAST_BPM;
    let step = |beats, bpm| TempoStep { beats, bpm };
    let all = Layers::ALL;
    let groove = INTRO_BARS;
    let pause = groove + GROOVE_BARS;
    let fast = pause + BREAK_BARS;
    SongSpec {
        sample_rate_hz: 44_100,
        duration_s: seconds,
        grid: Grid::Tempo(vec![step(slow_beats, SLOW_BPM), step(fast_beats, FAST_BPM)]),
        first_downbeat: 0,
        style: Style::Disco,
        key: Key {
            tonic: 9,
            minor: true,
        },
        sections: vec![
            section(
                0,
                Layers {
                    lead: false,
                    bass: false,
                    ..all
                },
                0.4,
            ),
            section(groove, Layers { lead: false, ..all }, 0.6),
            section(groove + 2, all, 0.8),
            section(
                pause,
                Layers {
                    drums: false,
                    bass: false,
                    ..all
                },
                0.4,
            ),
            section(fast, all, 0.9),
            section(fast + FAST_BARS, Layers::NONE, 0.0),
        ],
        mix: Mix::demo(),
        seed: 2,
    }
}

pub(super) fn render() -> Song {
    // The spec is a constant of this file and its test renders it.
    spec().render().unwrap_or(Song {
        sample_rate_hz: 44_100,
        samples: Vec::new(),
        beats_s: Vec::new(),
        downbeats: Vec::new(),
    })
}
