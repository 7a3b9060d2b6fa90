//! `--speed max` is repeatable: same seed, same input, same commands, byte
//! for byte.

use crate::program::Program;
use crate::recording::Recording;

fn recording(program: &Program, name: &str, seed: &str) -> Recording {
    let file = format!("{name}.mcap");
    program.succeed(&[
        "dance",
        "clicks.wav",
        "--seed",
        seed,
        "--record",
        &file,
        "--no-picture",
        "--quiet",
    ]);
    Recording::read(&program.path(&file))
}

#[test]
fn same_seed_same_commands_other_seed_other_dance() {
    let program = Program::new();
    program.click_track("clicks.wav", 12.0, 120.0);
    let first = recording(&program, "first", "7");
    let again = recording(&program, "again", "7");
    let other = recording(&program, "other", "8");
    for topic in [
        "/motion",
        "/joint_commands",
        "/joint_states",
        "/servo_truth",
    ] {
        assert!(!first.raw(topic).is_empty(), "{topic} is empty");
        assert!(first.raw(topic) == again.raw(topic), "{topic} differs");
    }
    assert!(first.raw("/joint_commands") != other.raw("/joint_commands"));
}
