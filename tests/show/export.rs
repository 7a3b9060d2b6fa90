//! A recording is read back and becomes other files.

use crate::program::Program;
use servodance::record::Recording;

fn recorded() -> Program {
    let program = Program::new();
    let arguments = ["dance", "--robot", "neck", "--record", "out.mcap"];
    program.succeed(&[&arguments[..], &["--no-picture", "--quiet"]].concat());
    program
}

#[test]
fn a_recording_becomes_a_moving_picture_bvh_and_csv() {
    let program = recorded();
    let recording = Recording::read(&program.path("out.mcap")).expect("a recording");
    assert_eq!(recording.robot, "neck");
    assert!(recording.root_at(1.0)[6] != 0.0 && recording.motion.at(1.0).is_some());
    let export = ["export", "out.mcap", "--gif", "a.gif", "--seconds", "2"];
    program.succeed(&[&export[..], &["--bvh", "a.bvh", "--csv", "a.csv"]].concat());
    let gif = std::fs::read(program.path("a.gif")).expect("the picture");
    let mut decoder = gif::DecodeOptions::new()
        .read_info(&gif[..])
        .expect("a GIF");
    let mut frames = 0;
    while decoder.read_next_frame().expect("a frame").is_some() {
        frames += 1;
    }
    assert_eq!(frames, 25);
    let bvh = std::fs::read_to_string(program.path("a.bvh")).expect("the motion");
    let motions = recording.motion.iter().count();
    assert!(bvh.contains(&format!("Frames: {motions}\n")));
    let csv = std::fs::read_to_string(program.path("a.csv")).expect("the joints");
    let mut lines = csv.lines();
    let names: Vec<&str> = recording.joints.iter().map(|j| j.0.as_str()).collect();
    assert_eq!(
        lines.next(),
        Some(format!("time_s,{}", names.join(",")).as_str())
    );
    let [first_s, last_s] = recording.span_s();
    let cycles = (last_s - first_s) * recording.control_hz;
    assert!((lines.count() as f64 - cycles).abs() <= 3.0);
}

#[test]
fn what_is_no_whole_recording_is_refused() {
    let program = recorded();
    let whole = std::fs::read(program.path("out.mcap")).expect("the recording");
    std::fs::write(program.path("cut.mcap"), &whole[..whole.len() / 2]).expect("half of it");
    std::fs::write(program.path("words.mcap"), "no recording").expect("words");
    let mut damaged = whole.clone();
    damaged[40..4000].fill(0xff);
    std::fs::write(program.path("damaged.mcap"), damaged).expect("a damaged one");
    for file in ["cut.mcap", "words.mcap", "damaged.mcap", "missing.mcap"] {
        program.refused(&["export", file, "--csv", "out.csv"], &[file]);
        program.refused(&["play", file, "--view"], &[file]);
    }
    let late = ["export", "out.mcap", "--gif", "late.gif", "--from", "1000"];
    program.refused(&late, &["1000"]);
}
