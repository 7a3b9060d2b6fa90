//! Both engines against what the PyTorch twin computes.

use super::{
    CODES_A_FRAME, Golden, STYLE, TINY, check_same, code_rows, danced_at_once, decoded,
    decoded_at_once, floats, hidden, slices,
};
use crate::engine::EngineKind;
use crate::vqvae::VqEncoder;
use crate::weights::Weights;

#[test]
fn decoding_at_once_agrees_with_the_twin() {
    let g = Golden::load();
    let motion = decoded_at_once(&g.weights, &g.codes);
    check_same("motion", &motion, &floats("motion"));
}

#[test]
fn streaming_decoding_agrees_with_the_twin() {
    let g = Golden::load();
    for kind in EngineKind::ALL {
        let motion = decoded(&g.weights, kind, &g.codes);
        check_same(kind.name(), &motion, &floats("motion"));
    }
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
fn motionseq_at_once_agrees_with_the_twin() {
    let g = Golden::load();
    for (name, music, style) in [("heard", Some(&g.music[..]), STYLE), ("deaf", None, None)] {
        let (seq, mut state) = danced_at_once(&g.weights, &g.previous, music, style);
        check_same(name, state.hidden(), &floats(&format!("{name}_hidden")));
        for code in 0..CODES_A_FRAME {
            let logits = seq.logits(&mut state, code, &slices(&g.codes)).unwrap();
            check_same(name, logits, &floats(&format!("{name}_logits{code}")));
        }
    }
}

#[test]
fn streaming_motionseq_agrees_with_the_twin() {
    let g = Golden::load();
    for kind in EngineKind::ALL {
        let [heard, _] = hidden(&g.weights, kind, &g.previous, &g.music, 1);
        check_same(kind.name(), &heard, &floats("heard_hidden"));
    }
}
