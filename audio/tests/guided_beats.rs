//! A person puts the tracker right: a range of tempi, two taps.

use servodance_audio::song::{Grid, Mix, Song, SongSpec, Style};
use servodance_audio::{MusicAnalyzer, TempoRange};
use servodance_types::MusicFrame;

const BPM: f64 = 124.0;

fn house(seconds: f64) -> Song {
    let beats_s: Vec<f64> = (0..).map(|i| f64::from(i) * 60.0 / BPM).take(200).collect();
    let mut spec = SongSpec::on_beats(&beats_s, seconds, 4).expect("a usable grid");
    spec.grid = Grid::Beats(beats_s);
    spec.style = Style::House;
    spec.mix = Mix::clean();
    spec.render().expect("a song")
}

/// Frames of the song; `taps_s` come when the music has come so far.
fn listen(song: &Song, analyzer: &mut MusicAnalyzer, taps_s: &[f64]) -> Vec<MusicFrame> {
    let (mut frames, mut pushed, mut taps) = (Vec::new(), 0, taps_s.iter().peekable());
    for block in song.samples.chunks(441) {
        analyzer.push(block);
        pushed += block.len();
        let now_s = pushed as f64 / f64::from(song.sample_rate_hz);
        while let Some(tap_s) = taps.next_if(|tap_s| **tap_s <= now_s) {
            analyzer.tap(*tap_s);
        }
        frames.extend(std::iter::from_fn(|| analyzer.pop()));
    }
    frames
}

/// The share of frames after `from_s` whose beats are `every` beats apart and `off`
/// beats late, within a tenth of a beat.
fn right(frames: &[MusicFrame], from_s: f64, every: f64, off: f64) -> f64 {
    let late: Vec<&MusicFrame> = frames.iter().filter(|f| f.time_s >= from_s).collect();
    let hit = late.iter().filter(|f| {
        let truth = (f.time_s * BPM / 60.0 - off) / every;
        let error = f64::from(f.beat.phase) - truth;
        (error - error.round()).abs() < 0.1
            && (f64::from(f.beat.tempo_bpm) * every / BPM - 1.0).abs() < 0.05
    });
    hit.count() as f64 / late.len() as f64
}

#[test]
fn no_tempo_outside_the_range_is_followed() {
    let song = house(20.0);
    let mut analyzer = MusicAnalyzer::new(song.sample_rate_hz).expect("a usable rate");
    analyzer.limit_tempo(TempoRange::new(50.0, 80.0).expect("a range"));
    for frame in listen(&song, &mut analyzer, &[]) {
        let bpm = frame.beat.tempo_bpm;
        assert!(bpm == 0.0 || (48.0..84.0).contains(&bpm), "{} s: {bpm}", frame.time_s);
    }
}

#[test]
fn two_taps_put_tempo_and_phase_right_and_they_stay() {
    let song = house(25.0);
    let beat_s = 60.0 / BPM;
    // Beats and half notes as they are, then the off-beats, which are wrong but wanted.
    for (every, off) in [(1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 0.5)] {
        let mut analyzer = MusicAnalyzer::new(song.sample_rate_hz).expect("a usable rate");
        let first_s = (16.0 + off) * beat_s;
        let taps_s = [first_s, first_s + every * beat_s];
        let frames = listen(&song, &mut analyzer, &taps_s);
        let share = right(&frames, taps_s[1] + 0.1, every, off);
        assert!(share > 0.95, "every {every} beats, {off} off: {share}");
    }
}

#[test]
fn one_tap_alone_changes_nothing() {
    let song = house(12.0);
    let listen_with = |taps_s: &[f64]| {
        let mut analyzer = MusicAnalyzer::new(song.sample_rate_hz).expect("a usable rate");
        listen(&song, &mut analyzer, taps_s)
    };
    assert_eq!(listen_with(&[6.2]), listen_with(&[]));
}
