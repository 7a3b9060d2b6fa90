//! Motion as files: `generate` and `reconstruct`.

use crate::program::Program;
use servodance_model::motion::Clip;

fn clip(program: &Program, arguments: &[&str], file: &str) -> Clip {
    program.succeed(&[arguments, &["--out", file, "--quiet"]].concat());
    Clip::read_npz(program.path(file)).unwrap()
}

#[test]
fn generated_motion_is_decided_by_seed_and_music() {
    let program = Program::new();
    program.click_track("clicks.wav", 6.0, 120.0);
    let generate = |seed, file| clip(&program, &["generate", "clicks.wav", "--seed", seed], file);
    let first = generate("7", "first.npz");
    assert_eq!((first.fps, first.poses.len()), (20.0, 121));
    assert_eq!(first.poses, generate("7", "again.npz").poses);
    assert_ne!(first.poses, generate("8", "other.npz").poses);

    let more = ["generate", "clicks.wav", "--seed", "7", "--seconds", "8"];
    let longer = clip(&program, &more, "longer.npz");
    assert_eq!(longer.poses.len(), 160);
    assert_eq!(longer.poses[..119], first.poses[..119]);

    program.succeed(&["generate", "clicks.wav", "--out", "first.bvh", "-q"]);
    let text = std::fs::read_to_string(program.path("first.bvh")).unwrap();
    assert!(text.starts_with("HIERARCHY\nROOT pelvis") && text.contains("Frames: 121\n"));
}

#[cfg(feature = "train")]
#[test]
fn reconstruction_stays_near_its_original() {
    let program = Program::new();
    program.click_track("clicks.wav", 8.0, 110.0);
    let start = ["generate", "clicks.wav", "--style", "disco"];
    clip(&program, &start, "dance.npz");
    let output = program.succeed(&[
        "reconstruct",
        "dance.npz",
        "--out",
        "back.npz",
        "--original",
        "same.npz",
    ]);
    let read = |file| Clip::read_npz(program.path(file)).unwrap().poses;
    let error_m = servodance_model::motion::mpjpe_m(&read("same.npz"), &read("back.npz")).unwrap();
    assert!((0.0005..0.06).contains(&error_m), "{error_m}");
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    let figure = format!("mean joint error {:.1} mm", 1e3 * error_m);
    assert!(told.contains(&figure), "{told} has not {figure}");
}

#[test]
fn motion_that_cannot_be_made_is_refused() {
    let program = Program::new();
    program.click_track("clicks.wav", 2.0, 120.0);
    std::fs::write(program.path("text.npz"), "no archive").unwrap();
    let generate = ["generate", "clicks.wav", "--out"];
    for (arguments, words) in [
        (&["a.txt"][..], &["a.txt", ".npz", ".bvh"][..]),
        (&["a.npz", "--seconds", "inf"], &["--seconds"]),
        (&["a.npz", "--lookahead", "9"], &["--lookahead", "0 to 5"]),
    ] {
        program.misused(&[&generate, arguments].concat(), words);
    }
    for (arguments, words) in [
        (
            &["generate", "clicks.wav", "--out", "a.npz", "--start", "text.npz"][..],
            &["text.npz"][..],
        ),
        #[cfg(feature = "train")]
        (&["reconstruct", "text.npz", "--out", "a.npz"], &["text.npz"]),
        #[cfg(feature = "train")]
        (&["reconstruct", "none.npz", "--out", "a.npz"], &["none.npz"]),
    ] {
        program.refused(arguments, words);
    }
}
