//! `train`: both stages on a minute of choreography.

use crate::program::Program;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use servodance_training::dataset::Split;
use servodance_training::dataset::training_file::{self, TrainingClip};
use std::path::Path;
use std::process::Stdio;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

const SETTINGS: &str = "\
preset = \"tiny\"
data = \"tiny.safetensors\"
out = \"runs\"
threads = 1

[vqvae]
steps = 60
batch = 8
report = 10
checkpoint = 20

[quantise]
free_steps = 10

[motionseq]
steps = 40
batch = 8
report = 10
";

/// Clips of choreography, two of them at least.
fn choreography() -> Vec<TrainingClip> {
    static BUILT: OnceLock<Vec<u8>> = OnceLock::new();
    let program = Program::new();
    let path = program.path("built");
    let built = BUILT.get_or_init(|| {
        program.succeed(&["dataset", "build", "built", "--choreography", "2", "-q"]);
        std::fs::read(&path).unwrap()
    });
    std::fs::write(&path, built).unwrap();
    training_file::read(&path).unwrap()
}

/// A training file of the first two, of these splits.
pub fn write_clips(path: &Path, splits: [Split; 2]) {
    let mut clips = choreography();
    for (clip, split) in clips.iter_mut().zip(splits) {
        clip.split = split;
    }
    training_file::write(path, &clips[..2], &serde_json::json!({})).unwrap();
}

fn program() -> Program {
    // The same bytes for every run: a checkpoint holds the hash of its data.
    static DATA: OnceLock<Vec<u8>> = OnceLock::new();
    let program = Program::new();
    let path = program.path("tiny.safetensors");
    let data = DATA.get_or_init(|| {
        write_clips(&path, [Split::Train, Split::Validation]);
        std::fs::read(&path).unwrap()
    });
    std::fs::write(&path, data).unwrap();
    std::fs::write(program.path("train.toml"), SETTINGS).unwrap();
    program
}

fn train<'a>(stage: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["train", stage, "--config", "train.toml"], more].concat()
}

/// A column of a stage's curves.
fn curve(program: &Program, stage: &str, column: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(program.path(&format!("runs/{stage}/curves.csv"))).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let at = names.iter().position(|name| *name == column).expect(column);
    let value = |line: &str| line.split(',').nth(at).unwrap().parse().unwrap_or(f64::NAN);
    lines.map(value).collect()
}

#[test]
fn both_stages_learn_and_what_they_learned_dances() {
    let program = program();
    for (stage, score) in [("vqvae", "val_loss"), ("motionseq", "val_nll")] {
        let output = program.succeed(&train(stage, &[]));
        let told = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(told.contains(&format!("runs/{stage}/weights.safetensors")), "{told}");
        let losses = curve(&program, stage, "loss");
        assert!(losses.last() < losses.first(), "{stage}: {losses:?}");
        let scores = curve(&program, stage, score);
        let known: Vec<f64> = scores.iter().copied().filter(|s| s.is_finite()).collect();
        assert!(known.len() >= 3 && known.last() < known.first(), "{stage}: {scores:?}");
        let picture = std::fs::read(program.path(&format!("runs/{stage}/curves.png"))).unwrap();
        assert_eq!(picture[1..4], *b"PNG");
    }
    // Codes come into use.
    let used = curve(&program, "vqvae", "codes_used");
    assert!(used.last().is_some_and(|share| *share > 0.3), "{used:?}");

    program.click_track("clicks.wav", 4.0, 120.0);
    let weights = "runs/motionseq/weights.safetensors";
    let generate = ["generate", "clicks.wav", "--model", weights, "--out", "dance.npz", "-q"];
    program.succeed(&generate);
    let clip = servodance_model::motion::Clip::read_npz(program.path("dance.npz")).unwrap();
    assert!(clip.poses.len() > 60);
    let weights = "runs/vqvae/weights.safetensors";
    program.succeed(&["reconstruct", "dance.npz", "--model", weights, "--out", "back.npz"]);
}

#[test]
fn a_paused_run_goes_on_to_the_same_bytes() {
    let (straight, paused) = (program(), program());
    for stage in ["vqvae", "motionseq"] {
        straight.succeed(&train(stage, &["-q"]));
        // Between two lines of the curves, and before the first codes.
        let output = paused.succeed(&train(stage, &["--until", "7"]));
        let told = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(told.contains("paused at step 7") && told.contains("--resume"), "{told}");
        paused.succeed(&train(stage, &["-q", "--until", "33", "--resume"]));
        paused.succeed(&train(stage, &["-q", "--resume", "--threads", "2"]));
        for file in ["last.safetensors", "weights.safetensors", "curves.csv"] {
            let [a, b] = [&straight, &paused].map(|program| {
                std::fs::read(program.path(&format!("runs/{stage}/{file}"))).unwrap()
            });
            assert!(a == b, "{stage}/{file} differs");
        }
    }
}

/// Waits for a file, as long as it takes a starved machine.
fn wait_for(path: &Path) {
    let began = Instant::now();
    while !path.exists() {
        assert!(began.elapsed() < Duration::from_secs(120), "{}", path.display());
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn ctrl_c_saves_and_says_how_to_go_on() {
    let program = program();
    let endless = SETTINGS.replace("steps = 60", "steps = 1000000");
    std::fs::write(program.path("train.toml"), endless).unwrap();
    let child = program
        .command(&train("vqvae", &[]))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait_for(&program.path("runs/vqvae/curves.csv"));
    kill(Pid::from_raw(child.id() as i32), Signal::SIGINT).unwrap();
    let output = child.wait_with_output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(130), "{told}");
    let last = told.lines().last().unwrap_or_default();
    assert!(last.contains("stopped at step"), "{told}");
    let command = last.split("servodance ").nth(1).expect("a command");
    let mut words: Vec<&str> = command.split_whitespace().collect();
    assert_eq!(words, train("vqvae", &["--resume"]));
    words.extend(["--until", "1"]);
    program.succeed(&words);
}

#[test]
fn what_cannot_be_trained_is_refused_in_one_line() {
    let program = program();
    let check = |text: &str, more: &[&str], words: &[&str]| {
        std::fs::write(program.path("train.toml"), text).unwrap();
        program.refused(&train("vqvae", more), words);
    };
    check("preset = \"huge\"\n", &[], &["train.toml:1:", "huge", "`live`, `paper`, `tiny`"]);
    check("seed = 1\n\n[vqvae]\nstep = 5\n", &[], &["train.toml:4:", "`step`", "`steps`"]);
    check("[loss]\ncommit = \"much\"\n", &[], &["train.toml:2:", "much"]);
    check("[vqvae]\nbatch = 0\n", &[], &["train.toml: vqvae.batch is 0, expected 1 to 4096"]);
    check(
        "model.parts = [\"tail\"]\ndata=\"tiny.safetensors\"\nout=\"runs\"",
        &[],
        &["tail", "left_arm"],
    );
    check("preset = \"tiny\"\n", &[], &["`data` is missing"]);
    check("data = \"no.safetensors\"\nout = \"runs\"\n", &[], &["no.safetensors"]);
    check("data = \"train.toml\"\nout = \"runs\"\n", &[], &["train.toml", "not a training file"]);
    check(SETTINGS, &["--threads", "0"], &["threads is 0"]);
    check(SETTINGS, &["--resume"], &["cannot go on from", "runs/vqvae/last.safetensors"]);
    program.refused(&["train", "vqvae", "--config", "no.toml"], &["no.toml"]);
    let words = ["weights of stage 1", "runs/vqvae/weights.safetensors", "train vqvae"];
    program.refused(&train("motionseq", &[]), &words);
    let not_weights = train("motionseq", &["--stage-one", "tiny.safetensors"]);
    program.refused(&not_weights, &["tiny.safetensors", "format"]);
}

#[test]
fn another_runs_checkpoint_is_refused_and_kept() {
    let program = program();
    program.succeed(&train("vqvae", &["-q", "--until", "3"]));
    let last = program.path("runs/vqvae/last.safetensors");
    let before = std::fs::read(&last).unwrap();
    let refused = |more: &[&str], words: &[&str]| {
        program.refused(&train("vqvae", more), words);
        assert!(std::fs::read(&last).unwrap() == before);
    };
    refused(&[], &["last.safetensors is there already", "--resume"]);
    refused(&["--resume", "--seed", "5"], &["last.safetensors", "`seed` is 1, expected 5"]);
    let wider = SETTINGS.replace("batch = 8", "batch = 9");
    std::fs::write(program.path("train.toml"), wider).unwrap();
    refused(&["--resume"], &["`run.batch` is 8, expected 9"]);
    std::fs::write(program.path("train.toml"), SETTINGS).unwrap();
    std::fs::write(&last, &before[..before.len() / 2]).unwrap();
    program
        .refused(&train("vqvae", &["--resume"]), &["last.safetensors", "not a whole checkpoint"]);
}
