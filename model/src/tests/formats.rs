//! Weights in other number formats.

use super::{Golden, TINY};
use crate::engine::{Engine, EngineKind, EngineOptions};
use crate::weights::{Dtype, Weights, convert};

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
        let bytes = convert(TINY, "tiny", dtype).unwrap();
        let weights = Weights::open(&bytes, "converted").unwrap();
        assert_eq!(weights.dtype(), dtype);
        let found = decoded(&weights, &g.codes);
        let gap: f32 = found.iter().zip(&expected).map(|(a, b)| (a - b).powi(2)).sum();
        assert!(gap <= size * tolerance * tolerance, "{dtype}: {gap} of {size}");
        // What is kept as blocks is what a wider format makes of it.
        let options = EngineOptions { threads: Some(1), ..EngineOptions::default() };
        assert_eq!(Engine::new(&weights, options).unwrap().dtype(), dtype);
        let wide = convert(&bytes, "converted", Dtype::F32).unwrap();
        let wide = Weights::open(&wide, "wide").unwrap();
        assert_eq!(decoded(&wide, &g.codes), found);
    }
}
