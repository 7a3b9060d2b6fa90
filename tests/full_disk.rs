//! A disk that is full ends the recording, not the dance.

use crate::program::Program;
use serde_json::Value;
use std::process::{Command, Stdio};

/// Runs the program where no file may grow beyond `blocks` of 512 bytes:
/// writes fail there as they do on a full disk.
fn with_little_room(program: &Program, blocks: u32, arguments: &[&str]) -> std::process::Output {
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"");
    Command::new("sh")
        .args(["-c", &script, "sh", env!("CARGO_BIN_EXE_servodance")])
        .args(arguments)
        .current_dir(program.path(""))
        .stdin(Stdio::null())
        .output()
        .expect("a shell")
}

#[test]
fn output_that_is_cut_is_no_success() {
    let program = Program::new();
    let full = std::fs::File::create("/dev/full").expect("a full disk");
    let run = program.command(&["robots"]).stdout(full).output().expect("it runs");
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(1), "{said}");
    assert!(said.contains("standard output could not be written"), "{said}");
}

#[test]
fn a_full_disk_ends_the_recording_and_not_the_dance() {
    let program = Program::new();
    let arguments = ["dance", "--record", "out.mcap", "--report", "out.json", "--no-picture"];
    let output = with_little_room(&program, 2000, &arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("cannot record to out.mcap"), "{said}");
    assert!(said.contains("all else goes on"), "{said}");
    let report = std::fs::read_to_string(program.path("out.json")).expect("a report");
    let report: Value = serde_json::from_str(&report).expect("JSON");
    assert!(report["audio_s"].as_f64() > Some(30.0), "{report}");
    let last = report["safety"].as_array().and_then(|log| log.last());
    assert_eq!(last.map(|event| &event["to"]), Some(&"Disarmed".into()));
    assert_eq!(program.files(), [program.path("out.json")]);
}
