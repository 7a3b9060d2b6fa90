//! `robot check`: exit codes and findings as scripts read them.

use crate::program::Program;

fn checked(program: &Program, file: &str) -> (Option<i32>, serde_json::Value) {
    let output = program.run(&["robot", "check", file, "--json"]);
    let json = serde_json::from_slice(&output.stdout).expect("JSON");
    (output.status.code(), json)
}

fn codes(json: &serde_json::Value) -> Vec<&str> {
    let findings = json["findings"].as_array().expect("findings");
    findings.iter().filter_map(|f| f["code"].as_str()).collect()
}

#[test]
fn every_built_in_robot_is_usable() {
    let program = Program::new();
    for robot in servodance_runtime::robot::BUILT_IN {
        let (exit, json) = checked(&program, robot.name);
        assert_eq!((exit, &json["usable"]), (Some(0), &true.into()), "{json}");
    }
}

#[test]
fn a_robot_on_its_feet_stands_is_pushed_and_dances() {
    let program = Program::new();
    let (exit, json) = checked(&program, "op3");
    let stance = &json["stance"];
    assert_eq!((exit, &stance["fell_s"]), (Some(0), &serde_json::Value::Null), "{json}");
    let pushes = stance["survived_push_ns"].as_array().expect("pushes");
    assert!(pushes.iter().all(|push| push.as_f64() > Some(0.5)), "{stance}");
    let (_, hung) = checked(&program, "torso13");
    assert!(hung.get("stance").is_none(), "{hung}");
}

#[test]
fn a_refused_description_says_all_that_is_wrong() {
    let program = Program::new();
    let urdf = include_str!("../configs/neck.urdf");
    let broken = urdf.replacen("<axis xyz=\"0 0 1\"/>", "<axis xyz=\"0 0 0\"/>", 1).replacen(
        "mass value=\"",
        "mass value=\"-",
        1,
    );
    std::fs::write(program.path("broken.urdf"), broken).unwrap();
    let (exit, json) = checked(&program, "broken.urdf");
    assert_eq!((exit, &json["usable"]), (Some(1), &false.into()));
    let found = codes(&json);
    assert!(found.contains(&"axis-zero") && found.contains(&"mass-unusable"), "{json}");
}

#[test]
fn robot_files_are_judged_with_their_description() {
    let program = Program::new();
    let toml = include_str!("../configs/neck.toml");
    let urdf = include_str!("../configs/neck.urdf");
    std::fs::write(program.path("neck.urdf"), urdf).unwrap();
    for (from, to, code) in [
        ("control_hz = 100", "control_hz = 1", "robot-file"),
        ("control_hz = 100", "control_hz = ", "toml"),
        ("neck.urdf", "nowhere.urdf", "file-unreadable"),
        ("direction = 1", "direction = 3", "servo-map"),
        ("baud = 1_000_000", "baud = 9_600", "bus-rate"),
        ("stance = \"hung\"", "stance = \"planted\"", "retarget"),
    ] {
        let changed = toml.replacen(from, to, 1);
        assert_ne!(changed, toml, "{from}");
        std::fs::write(program.path("my.toml"), changed).unwrap();
        let (exit, json) = checked(&program, "my.toml");
        assert_eq!((exit, codes(&json)[0]), (Some(1), code), "{to}: {json}");
    }
    let far = format!("{toml}\n[retarget.rest_deg]\nneck_tilt = 300\n");
    std::fs::write(program.path("my.toml"), far).unwrap();
    let (exit, json) = checked(&program, "my.toml");
    assert_eq!((exit, codes(&json)[0]), (Some(0), "rest-outside"), "{json}");
    let (exit, json) = checked(&program, "missing.urdf");
    assert_eq!((exit, codes(&json)), (Some(1), vec!["file-unreadable"]));
}

#[test]
fn a_file_of_twenty_thousand_links_is_refused_before_it_is_parsed() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("many.urdf");
    // Not even closed: were it parsed, that would be said.
    let text = format!("<robot name=\"many\">{}", "<link name=\"same\"/>".repeat(20_000));
    std::fs::write(&file, text).unwrap();
    let checked = servodance_runtime::robot::check(&file.display().to_string());
    let codes: Vec<&str> = checked.findings.iter().map(|found| found.code.as_str()).collect();
    assert_eq!(codes, ["links-many"]);
}
