//! What cannot be used is refused with one clear line, and nothing is left
//! behind.

use crate::program::Program;

const QUIET_OUTPUTS: [&str; 6] =
    ["--report", "out.json", "--record", "out.mcap", "--picture", "out.png"];

fn dance<'a>(arguments: &[&'a str]) -> Vec<&'a str> {
    let mut all = vec!["dance"];
    all.extend(arguments);
    all.extend(QUIET_OUTPUTS);
    all
}

#[test]
fn a_missing_recording_is_named() {
    let program = Program::new();
    program.refused(&dance(&["nowhere.ogg"]), &["nowhere.ogg"]);
}

#[test]
fn a_text_file_named_mp3_is_not_audio() {
    let program = Program::new();
    std::fs::write(program.path("words.mp3"), "la la la ".repeat(500)).unwrap();
    program.refused(&dance(&["words.mp3"]), &["words.mp3"]);
}

#[test]
fn an_empty_file_is_refused() {
    let program = Program::new();
    std::fs::write(program.path("empty.wav"), "").unwrap();
    program.refused(&dance(&["empty.wav"]), &["empty.wav"]);
}

#[test]
fn a_corrupt_file_is_refused() {
    let program = Program::new();
    program.click_track("good.wav", 2.0, 120.0);
    let mut bytes = std::fs::read(program.path("good.wav")).unwrap();
    bytes.truncate(30);
    std::fs::write(program.path("cut.wav"), bytes).unwrap();
    program.refused(&dance(&["cut.wav"]), &["cut.wav"]);
}

#[test]
fn silence_is_refused_as_silence() {
    let program = Program::new();
    program.wav("silent.wav", 3.0, |_| 0.0);
    program.refused(&dance(&["silent.wav"]), &["silent.wav", "silent"]);
}

#[test]
fn a_tenth_of_a_second_is_too_short() {
    let program = Program::new();
    program.click_track("short.wav", 0.1, 120.0);
    program.refused(&dance(&["short.wav"]), &["short.wav", "0.1"]);
}

#[test]
fn an_unknown_robot_lists_the_known_ones() {
    let program = Program::new();
    program.refused(&dance(&["--robot", "robbie"]), &["robbie", "op3"]);
}

#[test]
fn a_robot_without_feet_is_not_put_on_a_floor() {
    let program = Program::new();
    let arguments = dance(&["--robot", "torso13", "--world", "floor"]);
    program.refused(&arguments, &["torso13 does not stand", "--world stand"]);
}

#[test]
fn an_unknown_style_lists_the_known_ones() {
    let program = Program::new();
    program.misused(&dance(&["--style", "polka"]), &["polka", "salsa"]);
}

#[test]
fn a_wrong_key_in_a_robot_file_is_named_with_its_line() {
    let program = Program::new();
    let text = include_str!("../configs/op3.toml").replacen("control_hz", "control_herz", 1);
    let line = 1 + text.lines().position(|l| l.contains("control_herz")).unwrap();
    std::fs::write(program.path("my.toml"), text).unwrap();
    std::fs::write(program.path("op3.urdf"), include_str!("../configs/op3.urdf")).unwrap();
    let place = format!("my.toml:{line}");
    program.refused(&dance(&["--robot", "my.toml"]), &[&place, "control_herz"]);
}

#[test]
fn a_description_is_no_robot_file() {
    let program = Program::new();
    std::fs::write(program.path("my.urdf"), include_str!("../configs/op3.urdf")).unwrap();
    program.refused(&dance(&["--robot", "my.urdf"]), &["my.urdf", "servodance robot new"]);
}

#[test]
fn no_way_up_is_said_before_anything_moves() {
    Program::new().refused(&["getup", "--robot", "neck"], &["neck", "no way up", "[getup]"]);
}

#[test]
fn a_missing_urdf_is_named() {
    let program = Program::new();
    std::fs::write(program.path("my.toml"), include_str!("../configs/op3.toml")).unwrap();
    program.refused(&dance(&["--robot", "my.toml"]), &["my.toml", "op3.urdf"]);
}

#[test]
fn a_missing_serial_port_is_named() {
    let program = Program::new();
    let arguments = dance(&["--bus", "serial:/dev/ttyNOWHERE"]);
    program.refused(&arguments, &["/dev/ttyNOWHERE"]);
}

#[test]
fn an_unknown_bus_lists_the_choices() {
    let program = Program::new();
    program.refused(&dance(&["--bus", "bluetooth"]), &["bluetooth", "sim", "serial:"]);
}

#[test]
fn an_output_that_cannot_be_written_is_refused_before_the_robot_moves() {
    let program = Program::new();
    let arguments = ["dance", "--report", "no/such/folder/out.json", "--no-picture"];
    program.refused(&arguments, &["no/such/folder/out.json"]);
}

#[test]
fn no_pcm_on_standard_input_is_refused() {
    let program = Program::new();
    program.refused(&dance(&["-"]), &["standard input"]);
}

#[test]
fn weights_that_are_no_weights_are_refused() {
    let program = Program::new();
    std::fs::write(program.path("mine.safetensors"), "not weights").unwrap();
    program.refused(&dance(&["--model", "mine.safetensors"]), &["mine.safetensors"]);
}

#[test]
fn outputs_do_not_take_each_others_place_nor_the_songs() {
    let program = Program::new();
    program.click_track("song.wav", 2.0, 120.0);
    let more = ["--gif", "./x.gif", "--picture", "x.png"];
    let dance = |files: &[&'static str]| [&["dance", "song.wav"], files, &more].concat();
    let song = std::fs::read(program.path("song.wav")).unwrap();
    let run = program.run(&dance(&["--report", "song.wav"]));
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(2), "{said}");
    assert!(said.contains("--report") && said.contains(".json"), "{said}");
    assert_eq!(std::fs::read(program.path("song.wav")).unwrap(), song);
    program.refused(&dance(&["--record", "out", "--report", "./out"]), &["--report", "--record"]);
    program.succeed(&["dance", "song.wav", "--report", "x.json", "--no-picture", "--quiet"]);
}
