//! The program without the feature `train`: what it lacks, it names.

use crate::program::Program;

#[test]
fn without_training_the_program_says_how_to_build_it() {
    let program = Program::new();
    for words in [
        &["train", "vqvae", "--config", "train.toml"][..],
        &["dataset", "report", "data"],
        &["evaluate", "--json"],
        &["ablate"],
        &["reconstruct", "a.npz", "--out", "b.npz"],
        &["weights", "info"],
    ] {
        program.refused(words, &[words[0], "--features train"]);
    }
    program.click_track("clicks.wav", 2.0, 120.0);
    program.succeed(&["generate", "clicks.wav", "--out", "dance.npz", "-q"]);
    let again = ["generate", "clicks.wav", "--out", "again.npz", "-q"];
    for (more, what) in
        [(["--engine", "candle"], "engine candle"), (["--start", "dance.npz"], "encoder")]
    {
        program.refused(&[&again[..], &more].concat(), &[what, "--features train"]);
    }
}
