//! `ablate`: variants on four minutes of choreography.

use crate::conditioning::write_encodec;
use crate::program::Program;
use servodance_training::dataset::Split;
use servodance_training::dataset::training_file;

const SETTINGS: &str = "\
preset = \"tiny\"
threads = 1
[vqvae]
steps = 20
[motionseq]
steps = 20
";

/// Four clips, all but the first of them held out.
fn program() -> Program {
    let program = Program::new();
    program.succeed(&["dataset", "build", "built", "--choreography", "4", "-q"]);
    let mut clips = training_file::read(&program.path("built")).unwrap();
    let splits = [Split::Train, Split::Validation, Split::Test, Split::Test];
    assert_eq!(clips.len(), splits.len());
    for (clip, split) in clips.iter_mut().zip(splits) {
        clip.split = split;
    }
    let data = program.path("data.safetensors");
    training_file::write(&data, &clips, &serde_json::json!({})).unwrap();
    std::fs::write(program.path("train.toml"), SETTINGS).unwrap();
    program
}

fn ablate<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let always = [
        "ablate",
        "--config",
        "train.toml",
        "--data",
        "data.safetensors",
        "--out",
        "out",
        "--repeats",
        "2",
        "--clips",
        "2",
        "-q",
    ];
    [&always, more].concat()
}

#[test]
fn variants_are_trained_scored_and_kept() {
    let program = program();
    let only = ["--only", "sinusoidal"];
    let output = program.succeed(&ablate(&only));
    let told = String::from_utf8(output.stdout).unwrap();
    let csv = std::fs::read_to_string(program.path("out/ablation.csv")).unwrap();
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0][..3], ["variant", "nll", "nll_for_music"]);
    assert_eq!([rows[1][0], rows[2][0]], ["whole", "sinusoidal"]);
    for row in &rows[1..] {
        assert_eq!(row.len(), rows[0].len());
        assert!(told.contains(&format!("| {}: ", row[0])), "{told}");
        for value in &row[1..] {
            assert!(value.parse::<f64>().unwrap().is_finite(), "{row:?}");
        }
    }
    // The same codes, so the same error; other networks, so other likelihoods.
    let error = |row: usize| rows[row][3];
    assert_eq!((rows[0][3], error(1)), ("mpjpe_mm", error(2)));
    assert_ne!(rows[1][1], rows[2][1]);
    let exists = |path: &str| program.path(path).exists();
    assert!(exists("out/whole/vqvae/weights.safetensors"));
    assert!(exists("out/sinusoidal/motionseq/weights.safetensors"));
    assert!(!exists("out/sinusoidal/vqvae") && exists("out/ablation.png"));

    // What is there is not done again; what is half done goes on.
    let weights = |name: &str| {
        let path = format!("out/{name}/motionseq/weights.safetensors");
        let file = std::fs::metadata(program.path(&path)).unwrap();
        file.modified().unwrap()
    };
    let before = weights("whole");
    std::fs::remove_file(program.path("out/sinusoidal/figures.json")).unwrap();
    program.succeed(&ablate(&only));
    assert_eq!(before, weights("whole"));
    let again = std::fs::read_to_string(program.path("out/ablation.csv")).unwrap();
    assert_eq!(csv, again);
}

#[test]
fn a_variant_can_hear_encodec_and_its_weights_are_like_others() {
    let program = program();
    write_encodec(&program.path("encodec.safetensors"));
    // Latents of no music: what is tried is the way of the numbers.
    let mut clips = training_file::read(&program.path("data.safetensors")).unwrap();
    for clip in &mut clips {
        let latent = |at: usize| std::array::from_fn(|k| ((at * 7 + k * 3) as f32).sin());
        let latents = |music: &Vec<_>| (0..music.len()).map(latent).collect();
        clip.latents = clip.music.as_ref().map(latents);
    }
    let latents = program.path("latents.safetensors");
    training_file::write(&latents, &clips, &serde_json::json!({})).unwrap();

    let encodec = ["--encodec", "encodec.safetensors"];
    let only = ["--only", "encodec", "--latents"];
    let without = [&only[..], &["data.safetensors"], &encodec].concat();
    let output = program.run(&ablate(&without));
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("model.music is encodec128"), "{told}");

    program.succeed(&ablate(&[&only[..], &["latents.safetensors"], &encodec].concat()));
    let csv = std::fs::read_to_string(program.path("out/ablation.csv")).unwrap();
    let row: Vec<&str> = csv.lines().nth(2).unwrap().split(',').collect();
    assert_eq!(row[0], "encodec");
    for value in &row[1..] {
        assert!(value.parse::<f64>().unwrap().is_finite(), "{row:?}");
    }
    let weights = "out/encodec/motionseq/weights.safetensors";
    program.click_track("clicks.wav", 2.0, 120.0);
    let generate = ["generate", "clicks.wav", "--out", "a.npz", "--model", weights];
    program.succeed(&[&generate[..], &encodec].concat());
    let evaluate = ["evaluate", "--model", weights, "--data", "data.safetensors"];
    let evaluate = [&evaluate[..], &encodec].concat();
    program.refused(&evaluate, &["no such latents", "--music-features encodec128"]);
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let program = Program::new();
    std::fs::write(program.path("train.toml"), "tokens = 3\n").unwrap();
    program.refused(&ablate(&["--only", "legs"]), &["legs", "no-style", "encodec"]);
    program.refused(&ablate(&["--only", "encodec"]), &["--latents"]);
    program.refused(&ablate(&["--only", "no-style"]), &["train.toml"]);
    assert!(!program.path("out").exists());
}
