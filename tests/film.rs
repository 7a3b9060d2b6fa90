//! The song of a recording, and films: what the encoder is given, and what is said without one.

use crate::program::Program;
use crate::recording::Recording;
use std::os::unix::fs::PermissionsExt;

/// Pictures of a film: 960 by 640, four bytes a pixel.
const PICTURE: u64 = 960 * 640 * 4;

/// Stands for ffmpeg: keeps the pictures and the song that it gets.
const ENCODER: &str = r#"#!/bin/sh
case "$*" in
*-encoders*) echo " V..... libx264 H.264"; echo " A..... aac AAC"; exit 0;;
esac
cat > pictures
echo "$*" > words
while [ $# -gt 1 ]; do
  case "$1" in */song.wav) cp "$1" heard.wav;; esac
  shift
done
echo film > "$1"
"#;

fn recorded() -> Program {
    let program = Program::new();
    program.succeed(&["dance", "--robot", "neck", "--record", "out.mcap", "--no-picture", "-q"]);
    program
}

fn samples(path: &std::path::Path) -> Vec<i16> {
    let mut reader = hound::WavReader::open(path).expect("a WAV file");
    reader.samples().map(|sample| sample.expect("a sample")).collect()
}

#[test]
fn a_recording_holds_the_song_and_a_film_its_part_of_it() {
    let program = recorded();
    program.succeed(&["song", "--out", "song.wav"]);
    let song = samples(&program.path("song.wav"));
    let recording = Recording::read(&program.path("out.mcap"));
    let pieces = recording.raw("/audio").iter().flat_map(|(_, message)| {
        // Encapsulation, time, length; then the samples.
        let length = u32::from_le_bytes(message[12..16].try_into().expect("a length")) as usize;
        let pairs = message[16..16 + length].chunks_exact(2);
        pairs.map(|pair| i16::from_le_bytes([pair[0], pair[1]])).collect::<Vec<_>>()
    });
    let recorded: Vec<i16> = pieces.collect();
    assert!(recorded.len() > song.len() * 9 / 10, "{} of {}", recorded.len(), song.len());
    let apart = |(one, other): (&i16, &i16)| one.abs_diff(*other);
    let worst = recorded.iter().zip(&song).map(apart).max();
    assert!(worst <= Some(1), "{worst:?}");

    let encoder = program.path("ffmpeg");
    std::fs::write(&encoder, ENCODER).expect("the encoder");
    let executable = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(&encoder, executable).expect("the encoder");
    let path = format!("{}:/usr/bin:/bin", program.path("").display());
    let film = ["export", "out.mcap", "--film", "dance.mp4", "--from", "10", "--seconds", "2"];
    let output = program.command(&film).env("PATH", path).output().expect("the program runs");
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && told.contains("libx264 and aac"), "{told}");
    let length = std::fs::metadata(program.path("pictures")).expect("pictures").len();
    assert_eq!(length, 50 * PICTURE);
    let heard = samples(&program.path("heard.wav"));
    let reader = hound::WavReader::open(program.path("song.wav")).expect("the song");
    let from = 10 * reader.spec().sample_rate as usize;
    assert_eq!(heard.len(), 2 * reader.spec().sample_rate as usize);
    let same = |at: usize| heard.iter().zip(&recorded[at..]).all(|(one, other)| one == other);
    assert!((from - 2..=from + 2).any(same), "the film's song is another");
    let kept = std::fs::read(program.path("dance.mp4")).expect("the film");
    assert_eq!(kept, b"film\n");
}

#[test]
fn a_film_needs_an_ending_of_films_and_an_encoder() {
    let program = recorded();
    program
        .refused(&["export", "out.mcap", "--film", "dance.avi"], &["dance.avi", ".mp4 or .webm"]);
    let mut command = program.command(&["export", "out.mcap", "--film", "dance.mp4"]);
    let output = command.env("PATH", program.path("")).output().expect("the program runs");
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && told.contains("ffmpeg"), "{told}");
    assert_eq!(told.lines().count(), 1, "{told}");
    assert!(!program.path("dance.mp4").exists());
}
