//! A recording is read back and becomes other files.

use crate::program::Program;
use servodance_runtime::telemetry::recorder::{Recorder, Recording, RecordingTopic, WhenBehind};
use std::collections::BTreeMap;

fn recorded() -> Program {
    let program = Program::new();
    let arguments = ["dance", "--robot", "neck", "--record", "out.mcap"];
    program.succeed(&[&arguments[..], &["--no-picture", "--quiet"]].concat());
    program
}

/// How many pictures a moving one has.
fn frames(program: &Program, name: &str) -> usize {
    let gif = std::fs::read(program.path(name)).expect("the picture");
    let mut decoder = gif::DecodeOptions::new().read_info(&gif[..]).expect("a GIF");
    let mut frames = 0;
    while decoder.read_next_frame().expect("a frame").is_some() {
        frames += 1;
    }
    frames
}

#[test]
fn a_dance_draws_its_own_moving_picture() {
    let program = Program::new();
    let dance = ["dance", "--robot", "neck", "--no-picture", "--quiet", "--gif"];
    program.succeed(&[&dance[..], &["dance.gif"]].concat());
    assert_eq!(frames(&program, "dance.gif"), 250, "ten seconds");
    program.refused(&[&dance[..], &["no/such/dance.gif"]].concat(), &["no/such"]);
}

#[test]
fn a_recording_becomes_a_moving_picture_bvh_and_csv() {
    let program = recorded();
    let recording = Recording::read(&program.path("out.mcap")).expect("a recording");
    assert_eq!(recording.robot, "neck");
    assert!(recording.root_at(1.0)[6] != 0.0 && recording.motion.at(1.0).is_some());
    let export = ["export", "out.mcap", "--gif", "a.gif", "--seconds", "2"];
    program.succeed(&[&export[..], &["--bvh", "a.bvh", "--csv", "a.csv"]].concat());
    assert_eq!(frames(&program, "a.gif"), 50);
    let bvh = std::fs::read_to_string(program.path("a.bvh")).expect("the motion");
    let motions = recording.motion.iter().count();
    assert!(bvh.contains(&format!("Frames: {motions}\n")));
    let csv = std::fs::read_to_string(program.path("a.csv")).expect("the joints");
    let mut lines = csv.lines();
    let names: Vec<&str> = recording.joints.iter().map(|j| j.0.as_str()).collect();
    assert_eq!(lines.next(), Some(format!("time_s,{}", names.join(",")).as_str()));
    let [first_s, last_s] = recording.span_s();
    let cycles = (last_s - first_s) * recording.control_hz;
    assert!((lines.count() as f64 - cycles).abs() <= 3.0);
}

#[test]
fn spectrum_temperatures_and_events_are_recorded() {
    let program = recorded();
    let recording = Recording::read(&program.path("out.mcap")).expect("a recording");
    let (_, loud) = recording.spectrum.last_before(5.0).expect("a spectrum");
    assert!(loud.len() == 32 && loud.iter().any(|band| *band > 0.3), "{loud:?}");
    assert_eq!(recording.temperatures.len(), 2);
    for series in &recording.temperatures {
        let (_, celsius) = series.last_before(5.0).expect("a temperature");
        assert!((15.0..60.0).contains(celsius), "{celsius}");
    }
    let states: Vec<&str> = recording.events.iter().map(|(_, p)| p.state.as_str()).collect();
    assert_eq!(states, ["arming", "running", "stopping", "disarmed"]);
}

/// As recordings were before they had a spectrum, temperatures and events.
#[test]
fn an_older_recording_is_still_read() {
    let program = Program::new();
    let path = program.path("old.mcap");
    let joints = vec!["knee".to_owned()];
    let complain = Box::new(|text: &str| panic!("{text}"));
    let recorder = Recorder::create(&path, joints, WhenBehind::Wait, complain);
    let mut recorder = recorder.expect("a recorder");
    recorder.positions(RecordingTopic::JointStates, 0.0, &[0.25]);
    recorder.positions(RecordingTopic::JointStates, 1.0, &[0.5]);
    let limits = r#"[{"name": "knee", "lower_rad": -1, "upper_rad": 1,
        "velocity_rad_s": 1, "acceleration_rad_s2": 1}]"#;
    let fact = |(key, value): (&str, &str)| (key.to_owned(), value.to_owned());
    let facts = [("music_start_s", "0"), ("control_hz", "100"), ("joints", limits)];
    recorder.metadata(BTreeMap::from(facts.map(fact)));
    recorder.finish().expect("a file");
    let recording = Recording::read(&path).expect("a recording");
    assert_eq!(recording.states.at(1.0), Some(&vec![0.5]));
    assert!(recording.spectrum.at(1.0).is_none() && recording.events.at(1.0).is_none());
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
