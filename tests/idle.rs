//! Without music the robot idles, and dances again when music comes back.

use crate::program::Program;
use crate::recording::Recording;
use servodance_audio::song::Song;

const MUSIC_S: f64 = 13.0;
const SILENCE_S: f64 = 7.0;

/// Mean joint speed of the simulated servos between two moments of music.
fn speed_rad_s(recording: &Recording, from_s: f64, to_s: f64) -> f64 {
    let positions = recording.positions("/servo_truth");
    let within: Vec<_> =
        positions.iter().filter(|(time_s, _)| (from_s..to_s).contains(time_s)).collect();
    let moved: f64 = within
        .windows(2)
        .flat_map(|pair| pair[0].1.iter().zip(&pair[1].1))
        .map(|(a, b)| (b - a).abs())
        .sum();
    moved / within[0].1.len() as f64 / (to_s - from_s)
}

#[test]
fn silence_in_a_song_is_idled_through_and_the_dance_comes_back() {
    let program = Program::new();
    let song = Song::demo();
    let at = |time_s: f64| {
        let index = (time_s * f64::from(song.sample_rate_hz)) as usize;
        f64::from(song.samples.get(index).copied().unwrap_or_default())
    };
    let end_s = MUSIC_S + SILENCE_S;
    program.wav("break.wav", end_s + 12.0, |time_s| match time_s {
        t if t < MUSIC_S => at(t),
        t if t < end_s => 0.0,
        t => at(t - end_s + 4.0),
    });
    program.succeed(&["dance", "break.wav", "--record", "break.mcap", "--no-picture", "--quiet"]);
    let recording = Recording::read(&program.path("break.mcap"));
    let shares = recording.timed_numbers("/idle");
    let share_at = |moment_s: f64| {
        let after = shares.iter().find(|(time_s, _)| *time_s >= moment_s);
        after.expect("a share of idle").1
    };
    assert_eq!(share_at(MUSIC_S - 1.5), 0.0);
    assert_eq!(share_at(MUSIC_S + 2.0), 1.0);
    assert_eq!(share_at(end_s - 1.0), 1.0);
    assert_eq!(share_at(end_s + 3.0), 0.0);

    let dance = speed_rad_s(&recording, MUSIC_S - 5.0, MUSIC_S - 1.0);
    let breath = speed_rad_s(&recording, MUSIC_S + 2.5, end_s - 1.0);
    assert!(breath > 0.005, "stands still: {breath} rad/s");
    assert!(breath < 0.25 * dance, "{breath} against {dance} rad/s");
}

#[test]
fn a_robot_that_shall_hold_holds() {
    let program = Program::new();
    program.wav("hum.wav", 6.0, |t| 0.1 * (600.0 * t).sin());
    program.succeed(&[
        "dance",
        "hum.wav",
        "--idle",
        "rest",
        "--record",
        "hum.mcap",
        "--no-picture",
        "--quiet",
    ]);
    let recording = Recording::read(&program.path("hum.mcap"));
    assert!(speed_rad_s(&recording, 1.0, 6.0) < 1e-3);
}
