//! `weights` and `bench model`: what they say, and what they refuse.

use crate::program::Program;
use crate::training::write_clips;
use safetensors::SafeTensors;
use serde_json::Value;
use servodance_training::dataset::Split;

const TINY: &[u8] = include_bytes!("../model/src/tests/golden/tiny.safetensors");

/// A folder with the tiny model.
fn program() -> Program {
    let program = Program::new();
    std::fs::write(program.path("tiny.safetensors"), TINY).unwrap();
    program
}

/// What the program prints, as JSON.
fn json(program: &Program, arguments: &[&str]) -> Value {
    let output = program.succeed(arguments);
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// The tiny model with one number that is none.
fn with_nan(tensor: &str) -> Vec<u8> {
    let file = SafeTensors::deserialize(TINY).unwrap();
    let data = file.tensor(tensor).unwrap().data();
    let at = data.as_ptr() as usize - TINY.as_ptr() as usize;
    let mut bytes = TINY.to_vec();
    bytes[at + 8..at + 12].copy_from_slice(&f32::NAN.to_le_bytes());
    bytes
}

#[test]
fn info_says_what_a_file_holds() {
    let program = program();
    let built_in = json(&program, &["weights", "info", "--json"]);
    assert_eq!((&built_in["preset"], &built_in["dtype"]), (&"live".into(), &"q8_0".into()));
    assert_eq!(built_in["encoders"], false);
    let tiny = json(&program, &["weights", "info", "tiny.safetensors", "--json"]);
    assert_eq!(
        (&tiny["preset"], &tiny["dtype"], &tiny["bytes"]),
        (&"tiny".into(), &"f32".into(), &TINY.len().into())
    );
    let told = program.succeed(&["weights", "info", "tiny.safetensors"]);
    let told = String::from_utf8_lossy(&told.stdout).into_owned();
    assert!(told.contains("every tensor sound"), "{told}");
}

#[test]
fn info_refuses_what_is_not_sound() {
    let program = program();
    let info = ["weights", "info", "tiny.safetensors"];
    let other = [&info[..], &["--preset", "paper"]].concat();
    program.refused(&other, &["tiny.safetensors", "preset is `tiny`", "`paper`"]);
    let torn = program.path("torn.safetensors");
    std::fs::write(torn, &TINY[..TINY.len() - 9]).unwrap();
    let torn = ["weights", "info", "torn.safetensors"];
    program.refused(&torn, &["torn.safetensors", "not a whole safetensors file"]);
    let tensor = "seq.layers.1.cross.q.weight";
    std::fs::write(program.path("tiny.safetensors"), with_nan(tensor)).unwrap();
    program.refused(&info, &["tiny.safetensors", tensor, "2"]);
    program.refused(&["weights", "info", "none"], &["none", "No such file"]);
}

#[test]
fn convert_writes_every_format_and_what_it_writes_dances() {
    let program = program();
    program.click_track("clicks.wav", 2.0, 120.0);
    let mut sizes = Vec::new();
    for dtype in ["f32", "f16", "q8_0", "q6", "q4_0"] {
        let out = format!("{dtype}.safetensors");
        let convert = ["weights", "convert", "tiny.safetensors", "--dtype", dtype];
        program.succeed(&[&convert[..], &["--out", &out]].concat());
        let info = json(&program, &["weights", "info", &out, "--json"]);
        assert_eq!(info["dtype"], dtype);
        // These rows are shorter than a chunk of `q6`, which is filled up.
        if dtype != "q6" {
            sizes.push(info["bytes"].as_u64().unwrap());
        }
        let generate = ["generate", "clicks.wav", "--out", "dance.npz", "--model"];
        program.succeed(&[&generate[..], &[&*out, "-q"]].concat());
    }
    assert!(sizes.is_sorted_by(|wide, narrow| wide > narrow), "{sizes:?}");
    // There and back again: f32 holds what f16 held.
    let back = ["weights", "convert", "f16.safetensors", "--dtype", "f32"];
    program.succeed(&[&back[..], &["--out", "wide.safetensors"]].concat());
    let again = ["weights", "convert", "wide.safetensors", "--dtype", "f16"];
    program.succeed(&[&again[..], &["--out", "again.safetensors"]].concat());
    let read = |name: &str| std::fs::read(program.path(name)).unwrap();
    let (once, twice) = (read("f16.safetensors"), read("again.safetensors"));
    let once = SafeTensors::deserialize(&once).unwrap();
    let twice = SafeTensors::deserialize(&twice).unwrap();
    assert_eq!(once.len(), twice.len());
    for (name, tensor) in once.iter() {
        assert!(twice.tensor(name).unwrap().data() == tensor.data(), "{name}");
    }
}

#[test]
fn convert_leaves_nothing_behind_that_is_not_whole() {
    let program = program();
    let convert = |more: &[&'static str]| {
        let file = ["weights", "convert", "tiny.safetensors", "--dtype"];
        [&file[..], more].concat()
    };
    let unknown = program.run(&convert(&["q5_0", "--out", "out"]));
    let told = String::from_utf8_lossy(&unknown.stderr).into_owned();
    assert_eq!(unknown.status.code(), Some(2));
    assert!(told.contains("f32, f16, q8_0, q6, q4_0"), "{told}");
    let tensor = "vq.decoder.layers.0.ff.up.weight";
    std::fs::write(program.path("tiny.safetensors"), with_nan(tensor)).unwrap();
    program.refused(&convert(&["q8_0", "--out", "out"]), &[tensor]);
    std::fs::remove_file(program.path("tiny.safetensors")).unwrap();
    program.refused(&convert(&["f16", "--out", "out"]), &["tiny.safetensors"]);
}

#[test]
fn compare_holds_every_format_against_f32() {
    let program = program();
    write_clips(&program.path("data"), [Split::Test; 2]);
    let compare = ["weights", "compare", "tiny.safetensors", "--data", "data"];
    let rows = json(&program, &[&compare[..], &["--clips", "2", "--json"]].concat());
    let column = |name: &str| -> Vec<f64> {
        let rows = rows.as_array().unwrap().iter();
        rows.map(|row| row[name].as_f64().unwrap()).collect()
    };
    let dtypes: Vec<&Value> = rows.as_array().unwrap().iter().map(|r| &r["dtype"]).collect();
    assert_eq!(dtypes, ["f32", "f16", "q8_0", "q6", "q4_0"]);
    for kept in [column("codes_kept"), column("likeliest_kept")] {
        assert!(kept[0] == 1.0 && kept[1] > 0.9 && kept[2] > 0.9, "{kept:?}");
        assert!(kept[4] < kept[1], "four bits cost nothing: {kept:?}");
    }
    let nll = column("nll");
    // Four bits cost a network of random numbers more than a trained one.
    let off = |n: &f64| (n / nll[0] - 1.0).abs();
    assert!(nll[..4].iter().all(|n| off(n) < 0.02) && off(&nll[4]) < 0.1, "{nll:?}");
    assert!(column("frames").iter().all(|frames| *frames > 200.0));
}

#[test]
fn compare_needs_motion_that_was_held_out() {
    let program = program();
    write_clips(&program.path("data"), [Split::Train, Split::Test]);
    let compare = ["weights", "compare", "tiny.safetensors", "--data"];
    let few = "fewer than 2 held-out clips";
    program.refused(&[&compare[..], &["data"]].concat(), &["data", few]);
    program.refused(&[&compare[..], &["none"]].concat(), &["none"]);
    program.refused(&[&compare[..], &["tiny.safetensors"]].concat(), &["tiny"]);
}

#[test]
fn bench_model_tells_its_figures_as_json() {
    let program = program();
    let bench = ["bench", "model", "--preset", "tiny", "--frames", "5", "--json"];
    let more = ["--dtype", "q8_0", "--context", "12", "--threads", "2"];
    let said = json(&program, &[&bench[..], &more].concat());
    let expected: Value = serde_json::json!({
        "preset": "tiny", "dtype": "q8_0", "context": 12, "threads": 2, "frames": 5,
    });
    for (key, value) in expected.as_object().unwrap() {
        assert_eq!(&said[key], value, "{key}");
    }
    for key in ["ms_p50", "ms_p99", "weight_bytes", "read_gbps", "limit_ms"] {
        assert!(said[key].as_f64().is_some_and(|v| v > 0.0), "{key}: {said}");
    }
    let file = ["--model", "tiny.safetensors", "--guidance", "--position", "36000"];
    let said = json(&program, &[&bench[..], &file].concat());
    assert_eq!(
        (&said["lanes"], &said["position"], &said["dtype"]),
        (&2.into(), &36_000.into(), &"f32".into())
    );
}

#[test]
fn bench_model_refuses_what_it_cannot_measure() {
    let program = program();
    let bench = ["bench", "model", "--preset"];
    let misused = |more: &[&str], words: &[&str]| {
        program.misused(&[&bench[..], more].concat(), words);
    };
    let refused = |more: &[&str], words: &[&str]| {
        program.refused(&[&bench[..], more].concat(), words);
    };
    refused(&["huge"], &["huge", "live, paper, tiny"]);
    misused(&["tiny", "--context", "0"], &["--context", "1 to 4096"]);
    misused(&["tiny", "--frames", "0"], &["--frames"]);
    misused(&["tiny", "--threads", "0"], &["threads", "0", "1 to 64"]);
    let file = "tiny.safetensors";
    refused(&["live", "--model", file], &["preset is `tiny`", "`live`"]);
    refused(&["tiny", "--model", file, "--context", "9"], &["--context"]);
}
