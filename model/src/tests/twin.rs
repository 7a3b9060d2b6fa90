//! The networks against what the PyTorch twin computes.

use super::super::{VqEncoder, Weights};
use super::{Golden, STYLE, TINY, check_same, code_rows, decoded, flat, floats, hidden};

#[test]
fn one_shot_decoding_agrees_with_the_twin() {
    let g = Golden::load();
    check_same(
        "motion",
        &g.decoder.one_shot(&g.codes).unwrap().concat(),
        &floats("motion"),
    );
}

#[test]
fn streaming_decoding_agrees_with_the_twin() {
    let weights = Weights::open(TINY, "tiny").unwrap();
    check_same(
        "motion",
        &decoded(&weights, &code_rows("codes")),
        &floats("motion"),
    );
}

#[test]
fn encoding_gives_the_codes_of_the_twin() {
    let encoder = VqEncoder::load(&Weights::open(TINY, "tiny").unwrap()).unwrap();
    let poses = floats("poses");
    let expected = code_rows("encoded");
    assert!(expected.iter().any(|row| row != &expected[0]));
    assert_eq!(encoder.encode(poses.as_chunks().0).unwrap(), expected);
}

#[test]
fn one_shot_motionseq_agrees_with_the_twin() {
    let g = Golden::load();
    for (name, music, style) in [("heard", Some(&g.music[..]), STYLE), ("deaf", None, None)] {
        let hidden = g.seq.one_shot(&g.previous, music, style).unwrap();
        check_same(name, &flat(&hidden), &floats(&format!("{name}_hidden")));
        for part in 0..2 {
            let logits = g.seq.logits(part, &hidden, &g.codes).unwrap();
            check_same(
                name,
                &flat(&logits),
                &floats(&format!("{name}_logits{part}")),
            );
        }
    }
}

#[test]
fn streaming_motionseq_agrees_with_the_twin() {
    let g = Golden::load();
    let weights = Weights::open(TINY, "tiny").unwrap();
    let [heard, _] = hidden(&weights, &g.previous, &g.music, 1);
    check_same("hidden", &heard, &floats("heard_hidden"));
}
