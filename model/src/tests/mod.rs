//! Tests of the networks, and what they share: the tiny model and its ways to
//! compute.
//!
//! `golden/` is written by `model/reference/golden.py`: a tiny model with
//! random weights, and what the twin computes with it.

mod dance;
mod formats;
mod refusals;
mod streaming;
mod twin;

use candle_core::Tensor;
use safetensors::SafeTensors;

use super::{
    Dtype, Engine, EngineOptions, MotionSeq, OneShotDecoder, OneShotSeq, VqDecoder, Weights,
};

pub(super) const TINY: &[u8] = include_bytes!("golden/tiny.safetensors");
const GOLDEN: &[u8] = include_bytes!("golden/golden.safetensors");
const TOLERANCE: f32 = 1e-4;
const STYLE: Option<usize> = Some(1);

struct Golden {
    decoder: OneShotDecoder,
    seq: OneShotSeq,
    codes: Vec<Vec<usize>>,
    previous: Vec<Vec<usize>>,
    music: Vec<f32>,
}

impl Golden {
    fn load() -> Self {
        let weights = Weights::open(TINY, "tiny").unwrap();
        let codes = code_rows("codes");
        let mut previous = codes.clone();
        previous.rotate_right(1);
        previous[0] = codes[0].clone();
        Self {
            decoder: OneShotDecoder::load(&weights).unwrap(),
            seq: OneShotSeq::load(&weights).unwrap(),
            codes,
            previous,
            music: floats("music"),
        }
    }
}

fn bytes_as<T>(name: &str, read: impl Fn([u8; 4]) -> T) -> Vec<T> {
    let golden = SafeTensors::deserialize(GOLDEN).unwrap();
    let view = golden.tensor(name).unwrap();
    view.data()
        .as_chunks::<4>()
        .0
        .iter()
        .map(|b| read(*b))
        .collect()
}

/// Rows of one code per part (the tiny model has two parts).
pub(super) fn code_rows(name: &str) -> Vec<Vec<usize>> {
    let codes = bytes_as(name, |b| i32::from_le_bytes(b) as usize);
    codes.chunks(2).map(<[usize]>::to_vec).collect()
}

pub(super) fn floats(name: &str) -> Vec<f32> {
    bytes_as(name, f32::from_le_bytes)
}

pub(super) fn check_same(what: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let gaps = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    let worst = gaps.fold(0.0, f32::max);
    let largest = expected.iter().fold(0f32, |m, v| m.max(v.abs()));
    assert!(
        largest > 0.1,
        "{what}: the expected numbers are all near zero"
    );
    assert!(
        worst <= TOLERANCE * largest.max(1.0),
        "{what}: off by {worst}"
    );
}

pub(super) fn flat(tensor: &Tensor) -> Vec<f32> {
    tensor.flatten_all().unwrap().to_vec1().unwrap()
}

/// Two threads, f32.
fn engine(weights: &Weights) -> Engine {
    let options = EngineOptions {
        dtype: Some(Dtype::F32),
        threads: Some(2),
    };
    Engine::new(weights, options).unwrap()
}

/// Motion of the codes, a frame at a time.
fn decoded(weights: &Weights, codes: &[Vec<usize>]) -> Vec<f32> {
    let engine = engine(weights);
    let decoder = VqDecoder::load(weights, &engine).unwrap();
    let mut state = decoder.start();
    let team = engine.pool().team();
    let frames = codes.iter();
    frames
        .flat_map(|codes| decoder.step(&team, &mut state, codes).to_vec())
        .collect()
}

/// Hidden vectors of each lane, a frame at a time; lane 1 hears nothing.
pub(super) fn hidden(
    weights: &Weights,
    previous: &[Vec<usize>],
    music: &[f32],
    lanes: usize,
) -> [Vec<f32>; 2] {
    let engine = engine(weights);
    let seq = MotionSeq::load(weights, &engine).unwrap();
    let mut state = seq.start(lanes);
    seq.restyle(&mut state, &seq.style(STYLE));
    let team = engine.pool().team();
    let mut found = [Vec::new(), Vec::new()];
    for (codes, music) in previous.iter().zip(music.chunks(39)) {
        seq.step(&team, &mut state, codes, &[Some(music), None][..lanes]);
        for (lane, found) in found.iter_mut().enumerate().take(lanes) {
            found.extend(state.hidden(lane));
        }
    }
    found
}
