//! `dataset`: motion comes in, is looked over, becomes a training file.

use crate::program::Program;
use servodance_model::motion::{Clip, Pose};
use servodance_training::dataset::training_file;
use servodance_training::dataset::{Split, index};

/// A folder `in` with a dance as npz and BVH.
fn dancer() -> (Program, Clip) {
    let program = Program::new();
    std::fs::create_dir(program.path("in")).unwrap();
    program.click_track("clicks.wav", 8.0, 120.0);
    for file in ["in/dance.npz", "in/dance.bvh"] {
        program.succeed(&["generate", "clicks.wav", "--style", "disco", "--out", file, "-q"]);
    }
    let clip = Clip::read_npz(program.path("in/dance.npz")).unwrap();
    (program, clip)
}

/// What the program says while it succeeds.
fn told(program: &Program, arguments: &[&str]) -> String {
    let output = program.succeed(arguments);
    let text = [output.stderr, output.stdout].concat();
    String::from_utf8_lossy(&text).into_owned()
}

#[test]
fn bad_files_are_skipped_by_name_and_reason_and_the_good_one_comes_in() {
    let (program, clip) = dancer();
    let write = |name: &str, change: &dyn Fn(&mut Vec<Pose>)| {
        let mut bad = clip.clone();
        change(&mut bad.poses);
        bad.write_npz(program.path(&format!("in/{name}.npz"))).unwrap();
    };
    write("nan", &|poses| poses[7][20][1] = f32::NAN);
    write("empty", &Vec::clear);
    write("short", &|poses| poses.truncate(10));
    write("hands", &|poses| poses[30].swap(20, 21));
    let whole = std::fs::read(program.path("in/dance.npz")).unwrap();
    std::fs::write(program.path("in/torn.npz"), &whole[..whole.len() / 2]).unwrap();
    let text = told(&program, &["dataset", "import", "npz", "in", "--out", "data", "--dance"]);
    for words in [
        "nan.npz: frame 7, joint left_wrist: position is not finite",
        "empty.npz",
        "short.npz: 0.45 s of motion",
        "hands.npz: frame 30: left_wrist and right_wrist are exchanged",
        "torn.npz: cannot read motion",
        "data: 1 clips, 0.1 minutes, 0 with music; 5 files skipped",
    ] {
        assert!(text.contains(words), "no {words:?} in {text}");
    }
    let back = Clip::read_npz(program.path("data/npz/dance.npz")).unwrap();
    assert_eq!((back.fps, back.poses.len()), (20.0, clip.poses.len()));
    assert!(back.poses[0][0][0].abs() < 1e-5 && back.poses[0][0][2].abs() < 1e-5);
}

#[test]
fn imports_add_up_and_can_be_looked_over() {
    let (program, clip) = dancer();
    let bvh = ["dataset", "import", "bvh", "in", "--out", "data", "--dance"];
    let text = told(&program, &[&bvh[..], &["--source", "home", "--style", "disco"]].concat());
    assert!(text.contains("left_wrist: left_wrist"), "{text}");
    told(&program, &["dataset", "import", "npz", "in", "--out", "data", "--licence", "CC0, free"]);
    let entries = index::read(&program.path("data")).unwrap();
    assert_eq!(entries.len(), 2);
    assert_eq!((entries[1].source.as_str(), entries[1].licence.as_str()), ("npz", "CC0, free"));
    let [home, npz] = ["home", "npz"].map(|source| {
        let path = program.path(&format!("data/{source}/dance.npz"));
        Clip::read_npz(path).unwrap().poses
    });
    let gaps = home.iter().flatten().flatten().zip(npz.iter().flatten().flatten());
    let largest = gaps.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    // BVH bends its stiff pelvis and chest a little.
    assert!(largest < 0.06, "BVH and npz of one dance differ by {largest} m");

    let table = told(&program, &["dataset", "report", "data"]);
    for words in ["home", "CC0, free", "foot skate", "minutes of dance by tempo"] {
        assert!(table.contains(words), "no {words:?} in {table}");
    }
    let sheet = std::fs::read(program.path("data/sheet.png")).unwrap();
    assert_eq!(sheet[1..4], *b"PNG");
    let json = told(&program, &["dataset", "report", "data", "--json"]);
    let found: serde_json::Value = serde_json::from_str(&json).unwrap();
    let minutes = found["sources"][0]["dance_minutes"].as_f64().unwrap();
    assert!((minutes - clip.duration_s() / 60.0).abs() < 1e-3, "{found}");
    let tempi = found["tempi"].as_object().unwrap().values();
    let with_tempo: f64 = tempi.map(|minutes| minutes.as_f64().unwrap()).sum();
    assert!((with_tempo - minutes).abs() < 1e-6, "{found}");
}

#[test]
fn a_dance_with_its_music_becomes_training_data() {
    let (program, clip) = dancer();
    std::fs::create_dir(program.path("songs")).unwrap();
    std::fs::copy(program.path("clicks.wav"), program.path("songs/dance.wav")).unwrap();
    let import = ["dataset", "import", "npz", "in", "--out", "data", "--dance", "-q"];
    told(&program, &[&import[..], &["--music", "songs"]].concat());
    let build = ["dataset", "build", "data.safetensors", "--motion", "data"];
    told(&program, &[&build[..], &["--choreography", "0"]].concat());
    let clips = training_file::read(&program.path("data.safetensors")).unwrap();
    assert_eq!(clips.len(), 2, "the dance and its mirror image");
    for found in &clips {
        let music = found.music.as_ref().expect("its own music");
        assert_eq!((music.len(), found.motion.len()), (clip.poses.len() - 1, clip.poses.len() - 1));
        assert!(found.dance && !found.synthetic);
        assert_ne!(found.split, Split::Validation);
        // Clicks at 120 beats a minute: their tempo is heard in the end.
        let [.., octaves, confidence] = music[music.len() - 1];
        assert!(confidence > 0.3 && octaves.abs() < 0.1, "{octaves} {confidence}");
    }
}

#[test]
fn joints_can_be_told() {
    let (program, _) = dancer();
    let map = |text: &str| std::fs::write(program.path("joints.toml"), text).unwrap();
    let import = ["dataset", "import", "bvh", "in", "--out", "data", "--mapping", "joints.toml"];
    map("left_foot = \"left_ankle\"\n");
    assert!(told(&program, &import).contains("left_foot: left_ankle"));
    map("left_paw = \"left_ankle\"\n");
    program.refused(&import, &["joints.toml", "left_paw", "left_wrist"]);
    map("left_foot = \n");
    program.refused(&import, &["joints.toml: line 1"]);
}

#[test]
fn imports_that_cannot_be_made_are_refused() {
    let (program, _) = dancer();
    let import = ["dataset", "import", "--out", "data"];
    for (arguments, words) in [
        (["npz", "in", "--style", "polka"], ["polka", "hype"]),
        (["npz", "in", "--fps", "nan"], ["--fps", "1 to 1000"]),
    ] {
        program.misused(&[&import[..], &arguments].concat(), &words);
    }
    for (arguments, words) in [
        (&["npz", "in", "--source", "a/b"][..], &["--source", "a/b"][..]),
        (&["npz", "nowhere"], &["nowhere"]),
        (&["amc", "in"], &["in", ".amc"]),
        (&["npz", "in", "--music", "in"], &["--music", "wav"]),
    ] {
        program.refused(&[&import[..], arguments].concat(), words);
    }
    program.refused(&["dataset", "report", "in"], &["index.csv"]);
}

#[test]
fn minutes_to_build_are_numbers_and_need_their_motion() {
    let program = Program::new();
    let build = ["dataset", "build", "data.safetensors"];
    for (option, minutes) in [("--choreography", "nan"), ("--tilted", "inf")] {
        program.misused(&[&build[..], &[option, minutes]].concat(), &[option, "0 to 10000"]);
    }
    for (option, minutes, words) in [
        ("--tilted", "1", "--tilted needs --motion"),
        ("--figures", "1", "--figures needs --motion"),
    ] {
        program.refused(&[&build[..], &[option, minutes]].concat(), &[words]);
    }
    assert!(!program.path("data.safetensors").exists());
}
