//! The servos pause on the music's beats, and would not without compensation.

use crate::program::Program;
use serde_json::Value;

fn report(arguments: &[&str]) -> Value {
    let program = Program::new();
    let mut all = vec!["dance", "--report", "out.json", "--no-picture", "--quiet"];
    all.extend(arguments);
    program.succeed(&all);
    let text = std::fs::read_to_string(program.path("out.json")).expect("the report");
    serde_json::from_str(&text).expect("JSON")
}

fn number(report: &Value, pointer: &str) -> f64 {
    let value = report.pointer(pointer).and_then(Value::as_f64);
    value.unwrap_or_else(|| panic!("no number at {pointer}"))
}

/// On the beat, inside the pace, and better than without compensation. Of one style: the
/// medley's dances differ too much from each other for a ratio of two of them.
fn check(arguments: &[&str]) {
    let report = report(&[&["--style", "hype"], arguments].concat());
    let servos_ms = number(&report, "/alignment/servos/error_ms");
    let without_ms = number(&report, "/compensation/off_servos/error_ms");
    assert!(servos_ms <= 60.0, "{arguments:?}: {servos_ms} ms");
    assert!(
        servos_ms < 0.75 * without_ms,
        "{arguments:?}: {servos_ms} ms, without {without_ms} ms"
    );
    let dancer = number(&report, "/alignment/generator/fact");
    let servos = number(&report, "/alignment/servos/fact");
    assert!(servos > 0.8 * dancer, "{arguments:?}: {servos} of {dancer}");
    let pace = [0, 1].map(|end| number(&report, &format!("/compensation/pace/{end}")));
    assert!(pace[0] >= 0.8 - 1e-9 && pace[1] <= 1.25 + 1e-9, "{pace:?}");
    assert_eq!(report["violations"]["acceleration"], 0);
}

#[test]
fn a_recording_is_met() {
    check(&[]);
}

#[test]
fn music_of_which_nothing_is_known_ahead_is_met() {
    check(&["--as-live"]);
}

#[test]
fn the_medley_is_met() {
    let report = report(&[]);
    let servos_ms = number(&report, "/alignment/servos/error_ms");
    let without_ms = number(&report, "/compensation/off_servos/error_ms");
    assert!(servos_ms <= 60.0, "{servos_ms} ms");
    assert!(servos_ms < without_ms, "{servos_ms} ms, without {without_ms} ms");
    let dancer = number(&report, "/alignment/generator/fact");
    let servos = number(&report, "/alignment/servos/fact");
    assert!(servos > 0.8 * dancer, "{servos} of {dancer}");
    assert_eq!(report["violations"]["acceleration"], 0);
}
