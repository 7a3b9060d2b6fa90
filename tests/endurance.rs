//! The soak, a short one: music, noise and silence on the smallest robot while
//! something goes wrong every few seconds. The hour and the night are in
//! docs/show.md.

use crate::program::Program;
use serde_json::Value;

fn soak(program: &Program, more: &[&str]) -> Value {
    let arguments = ["soak", "--robot", "neck", "--piece", "12", "--quiet"];
    let output = program.succeed(&[&arguments[..], &["--report", "soak.json"], more].concat());
    let line = String::from_utf8_lossy(&output.stdout);
    assert!(line.lines().count() == 1 && line.contains("passed"), "{line}");
    let text = std::fs::read_to_string(program.path("soak.json")).expect("a report");
    serde_json::from_str(&text).expect("JSON")
}

#[test]
fn minutes_of_mischief_break_no_limit_and_leave_nothing_driven() {
    let program = Program::new();
    let summary = soak(&program, &["--minutes", "3", "--fault-every", "5"]);
    assert_eq!(summary["passed"], true, "{summary}");
    for kind in ["position", "velocity", "acceleration"] {
        assert_eq!(summary["violations"][kind], 0, "{summary}");
    }
    assert!(summary["music_s"].as_f64() >= Some(180.0), "{summary}");
    let faults = summary["faults"].as_object().expect("faults");
    let sum = |what: &str| -> u64 {
        let of = |tally: &Value| tally[what].as_u64().expect("a number");
        faults.values().map(of).sum()
    };
    let dances = summary["dances"].as_u64().expect("a number");
    let finished = summary["finished"].as_u64().expect("a number");
    assert!(sum("happened") >= 10, "{summary}");
    assert!(sum("recovered") > 0, "{summary}");
    assert_eq!(sum("stopped"), dances - finished, "{summary}");
    assert_eq!(sum("happened"), sum("recovered") + sum("stopped"));
    let looks = summary["memory"]["looks_mib"].as_array().expect("a list");
    assert!(looks.len() >= 20 || cfg!(not(target_os = "linux")), "{looks:?}");
    assert!(looks.iter().all(|look| look.as_f64() > Some(1.0)), "{looks:?}");
}

#[test]
fn recordings_may_be_soaked_and_what_is_none_is_refused() {
    let program = Program::new();
    program.click_track("clicks.wav", 20.0, 120.0);
    let summary = soak(&program, &["clicks.wav", "--minutes", "0.2"]);
    assert!(summary["music_s"].as_f64() >= Some(12.0), "{summary}");
    program.refused(&["soak", "nothing.wav", "--quiet"], &["nothing.wav"]);
    program.misused(&["soak", "--minutes", "0"], &["--minutes", "0.1 to 100000"]);
    program.refused(&["soak", "--report", "no/such/folder.json"], &["no/such"]);
}
