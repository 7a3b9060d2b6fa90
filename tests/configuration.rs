//! One robot file, what is set beside it, and who is blamed for what is wrong.

use crate::program::Program;

const DANCE: [&str; 3] = ["dance", "--no-picture", "--quiet"];

fn with<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&DANCE[..], &["--robot", "neck"], more].concat()
}

#[test]
fn a_key_set_on_the_command_line_or_in_the_environment_is_danced() {
    let program = Program::new();
    let report = ["--report", "out.json", "--set", "control_hz=50"];
    program.succeed(&with(&report));
    let rate = |program: &Program| {
        let text = std::fs::read_to_string(program.path("out.json")).expect("a report");
        let report: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        report["bus_stats"]["rate_hz"].as_f64().expect("a rate")
    };
    assert!((rate(&program) - 50.0).abs() < 0.5, "{}", rate(&program));
    let mut command = program.command(&with(&["--report", "out.json"]));
    let output = command.env("SERVODANCE_CONTROL_HZ", "40").output();
    assert!(output.expect("it runs").status.success());
    assert!((rate(&program) - 40.0).abs() < 0.5, "{}", rate(&program));
}

#[test]
fn every_mistake_is_blamed_on_who_made_it() {
    let program = Program::new();
    for (set, says) in [
        ("control_hz=5", "outside 20..1000"),
        ("control_hz=fast", "invalid type"),
        ("saftey.rearm=true", "unknown field `saftey`"),
        ("safety.rearming=true", "unknown field `rearming`"),
        ("safety.hold_s=1e6", "hold_s is 1000000"),
        ("joint.neck_pan.lower_deg=100", "neck_pan"),
        ("joint.neck_pan.direction=3", "must be 1 or -1"),
        ("joint.knee.id=3", "there are neck_pan, neck_tilt"),
        ("retarget.amplitude=2", "amplitude"),
        ("retarget.body.head=hat", "hat"),
        ("rearm", "expected KEY=VALUE"),
    ] {
        let blamed = format!("--set {set}");
        let words: &[&str] = match set {
            // Which of both limits is wrong nobody knows.
            "joint.neck_pan.lower_deg=100" => &[says],
            _ => &[says, &blamed],
        };
        program.refused(&with(&["--set", set]), words);
    }
    let mut command = program.command(&with(&[]));
    let output = command.env("SERVODANCE_SAFETY__HOLD_S", "soon").output();
    let error = String::from_utf8(output.expect("it runs").stderr).expect("text");
    let (variable, what) = ("SERVODANCE_SAFETY__HOLD_S: ", "invalid type");
    assert!(error.contains(variable) && error.contains(what), "{error}");
}

#[test]
fn a_variable_that_names_no_key_is_warned_of_and_the_dance_goes_on() {
    let program = Program::new();
    let mut command = program.command(&with(&[]));
    let output = command.env("SERVODANCE_COLOUR", "red").output();
    let output = output.expect("it runs");
    assert!(output.status.success());
    let said = String::from_utf8(output.stderr).expect("text");
    let warnings: Vec<&str> = said.lines().filter(|l| l.contains("COLOUR")).collect();
    assert_eq!(warnings.len(), 1, "{said}");
    assert!(warnings[0].contains("expected one of `name`"), "{said}");
}

#[test]
fn what_is_wrong_in_a_robot_file_is_named_with_its_line() {
    let program = Program::new();
    let urdf = include_str!("../configs/neck.urdf");
    std::fs::write(program.path("neck.urdf"), urdf).expect("the URDF");
    let good = include_str!("../configs/neck.toml");
    for (from, to) in [
        ("control_hz = 100", "control_hz = 5"),
        ("baud = 1_000_000", "baud = 1"),
        ("direction = 1", "direction = 3"),
        ("model = \"XM430-W350\"", "model = \"XM431\""),
        ("stance = \"hung\"", "amplitude = 2.0"),
        ("head = \"head_link\"", "head = \"hat\""),
        ("urdf = \"neck.urdf\"", "urdf = \"nick.urdf\""),
    ] {
        let text = good.replacen(from, to, 1);
        let line = 1 + text.lines().position(|l| l == to).expect("the line");
        std::fs::write(program.path("my.toml"), text).expect("a robot file");
        let place = format!("my.toml:{line}: ");
        let key = to.split(' ').next().expect("a key");
        program.refused(&["dance", "--robot", "my.toml", "--no-picture"], &[&place, key]);
    }
}

#[test]
fn the_schema_is_printed() {
    let program = Program::new();
    let output = program.succeed(&["schema", "robot"]);
    let schema: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(schema["additionalProperties"], false);
}
