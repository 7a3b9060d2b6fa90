//! Weights in other number formats.

use super::{Golden, TINY};
use crate::Codec;
use crate::engine::{Engine, EngineKind, EngineOptions};
use crate::weights::{Dtype, Keep, Weights, convert};

#[test]
fn converted_weights_give_nearly_the_same() {
    let g = Golden::load();
    let decoded =
        |weights: &Weights, codes: &[Vec<usize>]| super::decoded(weights, EngineKind::Own, codes);
    let expected = decoded(&Weights::open(TINY, "tiny").unwrap(), &g.codes);
    let size = expected.iter().map(|v| v * v).sum::<f32>();
    for (dtype, tolerance) in [
        (Dtype::F32, 0.0),
        (Dtype::F16, 1e-3),
        (Dtype::Q8_0, 2e-2),
        (Dtype::Q6, 0.1),
        (Dtype::Q4_0, 0.4),
    ] {
        let bytes = convert(TINY, "tiny", dtype, Keep::Everything).unwrap();
        let weights = Weights::open(&bytes, "converted").unwrap();
        assert_eq!(weights.dtype(), dtype);
        let found = decoded(&weights, &g.codes);
        let gap: f32 = found.iter().zip(&expected).map(|(a, b)| (a - b).powi(2)).sum();
        assert!(gap <= size * tolerance * tolerance, "{dtype}: {gap} of {size}");
        // What is kept as blocks is what a wider format makes of it.
        let options = EngineOptions { threads: Some(1), ..EngineOptions::default() };
        assert_eq!(Engine::new(&weights, options).unwrap().dtype(), dtype);
        let wide = convert(&bytes, "converted", Dtype::F32, Keep::Everything).unwrap();
        let wide = Weights::open(&wide, "wide").unwrap();
        assert_eq!(decoded(&wide, &g.codes), found);
    }
}

#[test]
fn weights_for_dancing_alone_decode_the_same_and_name_what_they_lack() {
    let g = Golden::load();
    let decoded = |bytes: &[u8]| {
        super::decoded(&Weights::open(bytes, "converted").unwrap(), EngineKind::Own, &g.codes)
    };
    let kept = |keep| convert(TINY, "tiny", Dtype::F16, keep).unwrap();
    let (whole, dance) = (kept(Keep::Everything), kept(Keep::Dance));
    assert!(dance.len() < whole.len());
    assert_eq!(decoded(&dance), decoded(&whole));
    let refused = Codec::from_bytes(&dance, "dance").unwrap_err().to_string();
    assert!(refused.contains("vq.encoder"), "{refused}");
}

#[test]
fn what_ships_is_made_of_what_was_trained() {
    let trained = concat!(env!("CARGO_MANIFEST_DIR"), "/weights/live.safetensors");
    let trained = Weights::read(trained.as_ref()).unwrap();
    let part = |dtype, keep| convert(&trained, "trained", dtype, keep).unwrap();
    // Not `assert_eq`, which would print megabytes.
    assert!(part(Dtype::Q8_0, Keep::Dance) == crate::weights::BUILT_IN);
    assert!(part(Dtype::F16, Keep::Encoders) == servodance_encoders::ENCODERS);
}
