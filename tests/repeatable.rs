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
    for topic in ["/motion", "/joint_commands", "/joint_states", "/servo_truth"] {
        assert!(!first.raw(topic).is_empty(), "{topic} is empty");
        assert!(first.raw(topic) == again.raw(topic), "{topic} differs");
    }
    assert!(first.raw("/joint_commands") != other.raw("/joint_commands"));
}

#[test]
fn raw_samples_on_standard_input_dance_like_the_file() {
    let program = Program::new();
    program.click_track("clicks.wav", 6.0, 110.0);
    let from_file = recording(&program, "file", "3");
    let mut samples = hound::WavReader::open(program.path("clicks.wav")).unwrap();
    let raw: Vec<u8> =
        samples.samples::<i16>().flat_map(|sample| sample.unwrap().to_le_bytes()).collect();
    std::fs::write(program.path("clicks.raw"), raw).unwrap();
    let output = program
        .command(&[
            "dance",
            "-",
            "--pcm-rate",
            "16000",
            "--seed",
            "3",
            "--record",
            "raw.mcap",
            "--no-picture",
            "--quiet",
        ])
        .stdin(std::fs::File::open(program.path("clicks.raw")).unwrap())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let from_raw = Recording::read(&program.path("raw.mcap"));
    assert!(from_file.raw("/joint_commands") == from_raw.raw("/joint_commands"));
}
