//! `evaluate`: the figures that scripts read, and what is refused.

use crate::conditioning::{metadata, random, write};
use crate::program::Program;
use crate::torque_off::alone;
use serde_json::Value;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

const T2M: &[u8] = include_bytes!("../training/src/metrics/t2m/golden/t2m.safetensors");

#[test]
fn evaluation_prints_every_figure_with_its_interval() {
    // It takes all processors, which real-time tests could not bear.
    let _alone = alone();
    let program = Program::new();
    let quick = [
        "evaluate",
        "--json",
        "--repeats",
        "2",
        "--clips",
        "3",
        "--seconds",
        "20",
        "--minutes",
        "1",
    ];
    let output = program.succeed(&quick);
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for key in [
        "mpjpe_mm",
        "codes_used",
        "fid_k",
        "fid_g",
        "fid_k_floor",
        "fid_g_floor",
        "dist_k",
        "dist_g",
        "pfc",
        "foot_skate",
        "jerk",
        "freeze_ratio",
        "figure_gap_m",
        "seeds_gap_m",
        "beat/fact",
        "beat/bailando",
        "beat/f1",
        "beat/wrong_song",
        "beat/shifted",
        "beat/silence",
        "real/dist_k",
        "real/beat/f1",
    ] {
        let value = found.pointer(&format!("/{key}")).unwrap_or_else(|| panic!("no {key}"));
        for part in ["mean", "ci95"] {
            let number = value[part].as_f64();
            assert!(number.is_some_and(|n| n.is_finite() && n >= 0.0), "{key}: {value}");
        }
    }
    // One minute is its own first and last one.
    assert_eq!(found["long"]["speed_kept"], 1.0, "{found}");
    assert!(found["seeds_gap_m"]["mean"].as_f64().unwrap() > 0.01, "{found}");
    let mean = |key: &str| found.pointer(&format!("/beat/{key}/mean")).unwrap().as_f64().unwrap();
    assert!(mean("f1") > mean("wrong_song") && mean("f1") > mean("shifted"), "{found}");
}

#[test]
fn evaluations_that_cannot_be_made_are_refused() {
    let program = Program::new();
    std::fs::write(program.path("data.safetensors"), "no tensors").unwrap();
    for (arguments, words) in [
        (&["evaluate", "--repeats", "1"][..], &["--repeats", "2 to 1000"][..]),
        (&["evaluate", "--seconds", "nan"], &["--seconds"]),
        (&["evaluate", "--style", "polka"], &["polka", "hype"]),
        (&["evaluate", "--top-p", "0"], &["top_p"]),
        (&["evaluate", "--blind", "vote", "--motion", ".", "--seconds", "2"], &["--seconds"]),
    ] {
        program.misused(arguments, words);
    }
    for file in ["data.safetensors", "none.safetensors"] {
        program.refused(&["evaluate", "--data", file], &[file]);
    }
}

/// Random numbers in the layout of the T2M extractors.
fn write_extractors(folder: &Path) {
    type Entry = (Vec<usize>, f32, f32);
    let golden = metadata(T2M);
    let manifest: BTreeMap<String, Entry> = serde_json::from_str(&golden["weights"]).unwrap();
    let tensors = manifest.into_iter().enumerate();
    let tensors: Vec<_> = tensors
        .map(|(seed, (name, (shape, base, scale)))| {
            let bytes = random(seed + 1, &shape, base, scale);
            (name, shape, bytes)
        })
        .collect();
    std::fs::create_dir_all(folder).unwrap();
    write(&folder.join("model.safetensors"), &tensors, HashMap::new());
    let list: HashMap<&str, Value> = ["words", "kinds", "kind_of"]
        .map(|key| (key, serde_json::from_str(&golden[key]).unwrap()))
        .into();
    let list = serde_json::to_string(&list).unwrap();
    std::fs::write(folder.join("words.json"), list).unwrap();
}

/// A folder as HumanML3D's with so many motions of 44 frames.
fn write_motions(folder: &Path, count: usize) {
    for part in ["new_joint_vecs", "texts"] {
        std::fs::create_dir_all(folder.join(part)).unwrap();
    }
    let names: Vec<String> = (0..count).map(|i| format!("{i:06}")).collect();
    for (i, name) in names.iter().enumerate() {
        let mut header =
            "{'descr': '<f4', 'fortran_order': False, 'shape': (44, 263), }".to_owned();
        header += &" ".repeat(117 - header.len());
        let mut npy = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        npy.extend(header.bytes().chain([b'\n']));
        npy.extend(random(i + 1, &[44, 263], 0.0, 0.1));
        let file = folder.join("new_joint_vecs").join(format!("{name}.npy"));
        std::fs::write(file, npy).unwrap();
        let text = "a person walks#a/DET person/NOUN walk/VERB#0.0#0.0\n";
        std::fs::write(folder.join("texts").join(format!("{name}.txt")), text).unwrap();
    }
    std::fs::write(folder.join("test.txt"), names.join("\n") + "\nlost\n").unwrap();
}

#[test]
fn texts_are_scored_with_extractors_of_the_users() {
    let _alone = alone();
    let program = Program::new();
    write_extractors(&program.path("data/servodance/t2m"));
    write_motions(&program.path("HumanML3D"), 33);
    let quick = ["evaluate", "--json", "--repeats", "2", "--clips", "2", "--seconds", "10"];
    let output = program
        .command(&quick)
        .args(["--texts", "HumanML3D"])
        .env("XDG_DATA_HOME", program.path("data"))
        .output()
        .expect("it runs");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{told}");
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let text = &found["text"];
    assert_eq!((&text["pairs"], &text["left_out"]), (&33.into(), &1.into()));
    for set in ["reconstructed", "real", "other_text"] {
        let mean = |key: &str| text[set][key]["mean"].as_f64().unwrap();
        let [top1, top2, top3] = [1, 2, 3].map(|k| mean(&format!("r_precision_{k}")));
        assert!(0.0 <= top1 && top1 <= top2 && top2 <= top3 && top3 <= 1.0, "{text}");
        assert!(mean("mm_dist") > 0.0, "{text}");
        assert!(text[set]["mm_dist"]["ci95"].as_f64().unwrap().is_finite());
    }
    // Through the codes a motion is another one.
    assert_ne!(text["real"]["mm_dist"], text["reconstructed"]["mm_dist"]);
}

#[test]
fn texts_without_their_files_are_told_in_one_line() {
    let program = Program::new();
    let evaluate = |more: &[&'static str]| [&["evaluate", "--texts", "HumanML3D"], more].concat();
    let extractors = evaluate(&["--extractors", "t2m"]);
    program.refused(&extractors, &["t2m/model.safetensors", "convert_t2m.py"]);
    write_extractors(&program.path("t2m"));
    program.refused(&extractors, &["HumanML3D/test.txt", "new_joint_vecs"]);
    write_motions(&program.path("HumanML3D"), 3);
    program.refused(&extractors, &["3 motions", "at least 32"]);
    std::fs::write(program.path("t2m/words.json"), "[]").unwrap();
    program.refused(&extractors, &["words.json", "not a list of words"]);
}
