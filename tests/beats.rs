//! `servodance beats`: both trackers on a song whose beats are known, and what
//! it refuses.

use crate::program::Program;
use serde_json::Value;
use servodance_audio::song::{Grid, Mix, Song, SongSpec, Style, TempoStep};

const SONG_S: f64 = 24.0;
const BPM: f64 = 124.0;
/// A beat this near to the true one is found; mir_eval's window.
const NEAR_S: f64 = 0.07;

/// Writes a song at 124 BPM as `song.wav`.
fn song(program: &Program) -> Song {
    let mut spec = SongSpec::random(SONG_S, 7).expect("a song");
    spec.sample_rate_hz = 16_000;
    spec.style = Style::House;
    spec.mix = Mix::clean();
    let beats = (SONG_S * BPM / 60.0) as usize + 1;
    spec.grid = Grid::Tempo(vec![TempoStep { beats, bpm: BPM }]);
    let song = spec.render().expect("sound");
    program.wav("song.wav", SONG_S, |t| f64::from(song.samples[(t * 16_000.0).round() as usize]));
    song
}

/// Times, one a line, increasing.
fn times_s(lines: &[u8]) -> Vec<f64> {
    let text = String::from_utf8_lossy(lines);
    let times: Vec<f64> = text.lines().map(|line| line.parse().expect("a time")).collect();
    assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{text}");
    times
}

/// Shares of the true beats that were found and of the found ones that are
/// true, from a moment on.
fn shares(truth: &[f64], found: &[f64], from_s: f64) -> [f64; 2] {
    let share = |some: &[f64], others: &[f64]| {
        let late: Vec<&f64> = some.iter().filter(|t| **t >= from_s).collect();
        let near = |t: &&&f64| others.iter().any(|other| (other - **t).abs() < NEAR_S);
        late.iter().filter(near).count() as f64 / late.len() as f64
    };
    [share(truth, found), share(found, truth)]
}

#[test]
fn both_trackers_find_the_beats_of_a_song() {
    let program = Program::new();
    let song = song(&program);
    // Live it takes five seconds to be sure.
    for (arguments, from_s) in
        [(&["beats", "song.wav"][..], 0.0), (&["beats", "song.wav", "--causal"], 5.0)]
    {
        let found = times_s(&program.succeed(arguments).stdout);
        let [hit, right] = shares(&song.beats_s, &found, from_s);
        assert!(
            hit > 0.9 && right > 0.9,
            "{arguments:?}: {hit} of the beats found, {right} of the found are beats"
        );
    }
}

#[test]
fn a_file_and_json_hold_the_same_beats() {
    let program = Program::new();
    song(&program);
    let printed = program.succeed(&["beats", "song.wav", "--causal"]).stdout;
    let quiet = program.succeed(&["beats", "song.wav", "--causal", "--out", "live.txt"]);
    assert!(quiet.stdout.is_empty(), "{quiet:?}");
    assert_eq!(std::fs::read(program.path("live.txt")).expect("a file"), printed);

    let json = program.succeed(&["beats", "song.wav", "--causal", "--json"]);
    let json: Value = serde_json::from_slice(&json.stdout).expect("JSON");
    assert_eq!(json["tracker"], "causal");
    let number = |name: &str| json[name].as_f64().expect("a number");
    assert!((number("audio_s") - SONG_S).abs() < 0.01);
    assert!((number("tempo_bpm") / BPM - 1.0).abs() < 0.02);
    let in_json = json["times_s"].as_array().expect("times");
    let lines = times_s(&printed);
    assert_eq!(in_json.len(), lines.len());
    for (exact, rounded) in in_json.iter().zip(&lines) {
        assert!((exact.as_f64().expect("a time") - rounded).abs() < 1e-4);
    }
}

#[test]
fn what_is_no_recording_is_refused_and_nothing_is_written() {
    let program = Program::new();
    song(&program);
    std::fs::write(program.path("words.ogg"), "la la la ".repeat(500)).expect("a file");
    std::fs::write(program.path("empty.wav"), "").expect("a file");
    program.wav("silent.wav", 3.0, |_| 0.0);
    for bad in ["nowhere.ogg", "words.ogg", "empty.wav", "silent.wav", "."] {
        for mode in [&[][..], &["--causal"], &["--json"]] {
            let mut arguments = vec!["beats", bad, "--out", "beats.txt"];
            arguments.extend(mode);
            program.refused(&arguments, &[bad]);
        }
    }
    let nowhere = "no/such/folder/beats.txt";
    program.refused(&["beats", "song.wav", "--out", nowhere], &[nowhere]);
    let unasked = program.run(&["beats"]);
    assert_eq!(unasked.status.code(), Some(2), "{unasked:?}");
}
