//! A robot file reads nothing outside its own folder, unless its user names it.

use crate::program::Program;
use std::os::unix::fs::symlink;

const URDF: &str = include_str!("../configs/neck.urdf");
const CHECK: [&str; 3] = ["robot", "check", "robot/my.toml"];

/// A folder with a robot file that names this description, and a stranger's
/// description beside the folder.
fn naming(urdf: &str) -> Program {
    let program = Program::new();
    program.click_track("clicks.wav", 3.0, 120.0);
    std::fs::create_dir_all(program.path("robot/urdf")).expect("a folder");
    std::fs::write(program.path("robot/urdf/own.urdf"), URDF).expect("a description");
    std::fs::write(program.path("strange.urdf"), URDF).expect("a description");
    name(&program, urdf);
    program
}

/// Lets the robot file name another.
fn name(program: &Program, urdf: &str) {
    let toml = include_str!("../configs/neck.toml").replacen("neck.urdf", urdf, 1);
    std::fs::write(program.path("robot/my.toml"), toml).expect("a robot file");
}

fn dance<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let robot = ["dance", "clicks.wav", "--no-picture", "--quiet", "--robot"];
    [&robot, more].concat()
}

#[test]
fn a_description_inside_the_folder_is_read() {
    let program = naming("urdf/own.urdf");
    symlink("urdf", program.path("robot/link")).expect("a link");
    for urdf in ["urdf/own.urdf", "./urdf/../urdf/own.urdf", "link/own.urdf"] {
        name(&program, urdf);
        program.succeed(&CHECK);
    }
}

#[test]
fn a_description_outside_the_folder_is_refused_with_what_to_do() {
    let program = naming("../strange.urdf");
    let absolute = program.path("strange.urdf").display().to_string();
    symlink("../strange.urdf", program.path("robot/link.urdf")).expect("a link");
    symlink("..", program.path("robot/folder")).expect("a link");
    for urdf in [
        "../strange.urdf",
        "urdf/../../strange.urdf",
        "link.urdf",
        "folder/strange.urdf",
        &absolute,
        "/dev/zero",
    ] {
        name(&program, urdf);
        let words = ["robot/my.toml:4: ", "urdf", urdf, "outside", "--set urdf="];
        program.refused(&dance(&["robot/my.toml"]), &words);
        let output = program.run(&[&CHECK[..], &["--json"]].concat());
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!(json["findings"][0]["code"], "file-outside", "{json}");
    }
    name(&program, "urdf");
    program.refused(&dance(&["robot/my.toml"]), &["my.toml:4: ", "no file"]);
}

#[test]
fn whoever_names_it_himself_gets_it() {
    let program = naming("gone.urdf");
    program.succeed(&dance(&["robot/my.toml", "--set", "urdf=../strange.urdf"]));
    let mut command = program.command(&dance(&["robot/my.toml"]));
    let output = command.env("SERVODANCE_URDF", "../strange.urdf").output();
    assert!(output.expect("it runs").status.success());
    // A built-in robot too is what its user says, seen from where he is.
    program.succeed(&dance(&["neck", "--set", "urdf=strange.urdf"]));
    let gone = ["neck", "--set", "urdf=gone.urdf"];
    program.refused(&dance(&gone), &["--set urdf=gone.urdf: ", "cannot read"]);
}

#[test]
fn a_new_robot_file_has_its_description_beside_it() {
    let program = naming("urdf/own.urdf");
    let new = ["robot", "new", "strange.urdf", "--out", "robot/new.toml"];
    let said = program.succeed(&new).stdout;
    let said = String::from_utf8(said).expect("text");
    assert!(said.starts_with("robot/new.toml\nrobot/new.urdf\n"), "{said}");
    std::fs::remove_file(program.path("strange.urdf")).expect("it was there");
    program.succeed(&dance(&["robot/new.toml"]));
    // What lies inside already is used where it is.
    let inside = ["robot", "new", "robot/urdf/own.urdf", "--out", "robot/own.toml"];
    program.succeed(&inside);
    let text = std::fs::read_to_string(program.path("robot/own.toml")).expect("a robot file");
    assert!(text.contains("urdf = \"urdf/own.urdf\""), "{text}");
    assert!(!program.path("robot/own.urdf").exists());
    // Nobody's file is overwritten unasked.
    std::fs::write(program.path("robot/two.urdf"), "mine").expect("a file");
    std::fs::write(program.path("strange.urdf"), URDF).expect("a description");
    let two = ["robot", "new", "strange.urdf", "--out", "robot/two.toml"];
    program.refused(&two, &["robot/two.urdf", "--force"]);
}
