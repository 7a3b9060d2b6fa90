//! `evaluate`: the figures that scripts read, and what is refused.

use crate::program::Program;
use crate::torque_off::alone;

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
        let value = found
            .pointer(&format!("/{key}"))
            .unwrap_or_else(|| panic!("no {key}"));
        for part in ["mean", "ci95"] {
            let number = value[part].as_f64();
            assert!(
                number.is_some_and(|n| n.is_finite() && n >= 0.0),
                "{key}: {value}"
            );
        }
    }
    // One minute is its own first and last one.
    assert_eq!(found["long"]["speed_kept"], 1.0, "{found}");
    assert!(
        found["seeds_gap_m"]["mean"].as_f64().unwrap() > 0.01,
        "{found}"
    );
    let mean = |key: &str| {
        found
            .pointer(&format!("/beat/{key}/mean"))
            .unwrap()
            .as_f64()
            .unwrap()
    };
    assert!(
        mean("f1") > mean("wrong_song") && mean("f1") > mean("shifted"),
        "{found}"
    );
}

#[test]
fn evaluations_that_cannot_be_made_are_refused() {
    let program = Program::new();
    std::fs::write(program.path("data.safetensors"), "no tensors").unwrap();
    for (arguments, words) in [
        (
            &["evaluate", "--repeats", "1"][..],
            &["--repeats", "2..1000"][..],
        ),
        (&["evaluate", "--seconds", "nan"], &["--seconds"]),
        (&["evaluate", "--style", "polka"], &["polka", "hype"]),
        (&["evaluate", "--top-p", "0"], &["top_p"]),
        (
            &["evaluate", "--data", "data.safetensors"],
            &["data.safetensors"],
        ),
        (
            &["evaluate", "--data", "none.safetensors"],
            &["none.safetensors"],
        ),
    ] {
        program.refused(arguments, words);
    }
}
