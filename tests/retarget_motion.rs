//! `retarget`: motion files in, joint positions out.

use crate::program::Program;

/// Some seconds of the choreographer as a BVH file.
fn dance(program: &Program) {
    let beats: Vec<_> = (0..16)
        .map(|beat| servodance_training::choreography::DanceBeat {
            time_s: f64::from(beat) * 0.5,
            downbeat: beat % 4 == 0,
        })
        .collect();
    let style = servodance_training::choreography::DanceStyle::Groove;
    let clip = servodance_training::choreography::choreograph(&beats, 8.0, style, 1);
    clip.write_npz(program.path("dance.npz")).expect("the npz");
    let bvh = servodance_model::motion::bvh_write::bvh(&clip);
    std::fs::write(program.path("dance.bvh"), bvh).expect("the BVH");
}

fn positions(program: &Program, file: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(program.path(file)).expect("the CSV");
    let mut lines = text.lines();
    let header = lines.next().expect("a header");
    let numbers = |line: &str| line.split(',').map(|n| n.parse().expect("a number")).collect();
    (header.split(',').map(str::to_owned).collect(), lines.map(numbers).collect())
}

#[test]
fn a_motion_file_becomes_joint_positions_and_figures() {
    let program = Program::new();
    dance(&program);
    for motion in ["dance.npz", "dance.bvh"] {
        let out = program.succeed(&[
            "retarget", motion, "--robot", "torso13", "--out", "a.csv", "--report", "r.json",
        ]);
        let said = String::from_utf8_lossy(&out.stdout).into_owned();
        assert_eq!(said.contains("left_elbow: left_elbow"), motion == "dance.bvh", "{said}");
        let (header, rows) = positions(&program, "a.csv");
        assert_eq!((header.len(), header[0].as_str()), (14, "time_s"));
        assert!(rows.len() > 700 && rows.iter().all(|row| row.len() == 14));
        assert!((rows[1][0] - 0.01).abs() < 1e-9);
        let report = std::fs::read(program.path("r.json")).expect("the report");
        let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
        for limit in ["position", "velocity", "acceleration"] {
            assert_eq!(report["violations"][limit], 0, "{motion}: {report}");
        }
        assert_eq!(report["interventions"], 0, "{motion}: {report}");
        let median = report["direction_error_median_deg"].as_f64().expect("a median");
        assert!(median < 15.0, "{motion}: {median} degrees");
        assert_eq!(report["counts"]["cycles"], report["cycles"]);
    }
}

#[test]
fn recordings_hold_the_commands() {
    let program = Program::new();
    dance(&program);
    let arguments = ["retarget", "dance.npz", "--robot", "neck", "--out", "a.mcap", "--quiet"];
    let out = program.succeed(&arguments);
    assert!(out.stdout.is_empty());
    let bytes = std::fs::read(program.path("a.mcap")).expect("the recording");
    let messages = mcap::MessageStream::new(&bytes).expect("an MCAP");
    let topics: Vec<String> =
        messages.map(|m| m.expect("a message").channel.topic.clone()).collect();
    let commands = topics.iter().filter(|topic| *topic == "/joint_commands");
    assert!(commands.count() > 700);
}

#[test]
fn what_cannot_be_retargeted_is_refused_in_one_line() {
    let program = Program::new();
    std::fs::write(program.path("bad.bvh"), "HIERARCHY\nROOT\n").unwrap();
    std::fs::write(program.path("bad.pkl"), b"\x80\x04K\x01.").unwrap();
    let retarget = |motion, out| {
        ["retarget", motion, "--robot", "torso13", "--out", out, "--report", "r.json"]
    };
    for (motion, words) in [
        ("nowhere.bvh", "nowhere.bvh"),
        ("bad.bvh", "bad.bvh: line 2"),
        ("bad.pkl", "no dictionary"),
        ("bad.fbx", ".npz (22 joints), .bvh, .pkl"),
    ] {
        program.refused(&retarget(motion, "a.csv"), &[words]);
    }
    program.misused(&retarget("bad.bvh", "a.txt"), &[".csv or .mcap"]);
}
