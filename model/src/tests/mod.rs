//! Tests of the networks, and what they share: the tiny model and its ways to
//! compute.
//!
//! `golden/` is written by `model/reference/golden.py`: a tiny model with
//! random weights, and what the twin computes with it.

mod absolute;
mod dance;
mod engines;
mod formats;
mod refusals;
mod streaming;
mod twin;

use safetensors::SafeTensors;

use crate::engine::{Engine, EngineKind, EngineOptions};
use crate::motionseq::{CandleSeq, CandleSeqState, MotionSeq};
use crate::vqvae::{CandleDecoder, VqDecoder};
use crate::weights::{Dtype, Weights};

pub(super) const TINY: &[u8] = include_bytes!("golden/tiny.safetensors");
const GOLDEN: &[u8] = include_bytes!("golden/golden.safetensors");
const TOLERANCE: f32 = 1e-4;
const STYLE: Option<usize> = Some(1);

struct Golden {
    weights: Weights<'static>,
    codes: Vec<Vec<usize>>,
    previous: Vec<Vec<usize>>,
    music: Vec<f32>,
}

impl Golden {
    fn load() -> Self {
        let codes = code_rows("codes");
        let mut previous = codes.clone();
        previous.rotate_right(1);
        previous[0] = codes[0].clone();
        Self {
            weights: Weights::open(TINY, "tiny").unwrap(),
            codes,
            previous,
            music: floats("music"),
        }
    }
}

fn slices(rows: &[Vec<usize>]) -> Vec<&[usize]> {
    rows.iter().map(Vec::as_slice).collect()
}

/// Motion of the codes, all frames at once, by the candle engine.
fn decoded_at_once(weights: &Weights, codes: &[Vec<usize>]) -> Vec<f32> {
    let decoder = CandleDecoder::load(weights, Dtype::F32).unwrap();
    let mut state = decoder.start();
    let motion = decoder.frames(&mut state, &slices(codes)).unwrap();
    motion.to_vec()
}

/// MotionSeq after all frames at once, by the candle engine.
fn danced_at_once(
    weights: &Weights,
    previous: &[Vec<usize>],
    music: Option<&[f32]>,
    style: Option<usize>,
) -> (CandleSeq, CandleSeqState) {
    let engine = engine(weights, EngineKind::Own);
    let styled = MotionSeq::load(weights, &engine).unwrap();
    let seq = CandleSeq::load(weights, Dtype::F32).unwrap();
    let mut state = seq.start(1);
    state.style = styled.scales(styled.style(style));
    seq.frames(&mut state, &slices(previous), &[music]).unwrap();
    (seq, state)
}

fn bytes_as<T>(name: &str, read: impl Fn([u8; 4]) -> T) -> Vec<T> {
    let golden = SafeTensors::deserialize(GOLDEN).unwrap();
    let view = golden.tensor(name).unwrap();
    view.data().as_chunks::<4>().0.iter().map(|b| read(*b)).collect()
}

/// Codes of a frame of the tiny model: two of one part, one of the other.
const CODES_A_FRAME: usize = 3;

/// The codes of all frames.
pub(super) fn code_rows(name: &str) -> Vec<Vec<usize>> {
    let codes = bytes_as(name, |b| i32::from_le_bytes(b) as usize);
    codes.chunks(CODES_A_FRAME).map(<[usize]>::to_vec).collect()
}

pub(super) fn floats(name: &str) -> Vec<f32> {
    bytes_as(name, f32::from_le_bytes)
}

pub(super) fn check_same(what: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let gaps = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    let worst = gaps.fold(0.0, f32::max);
    let largest = expected.iter().fold(0f32, |m, v| m.max(v.abs()));
    assert!(largest > 0.1, "{what}: the expected numbers are all near zero");
    assert!(worst <= TOLERANCE * largest.max(1.0), "{what}: off by {worst}");
}

/// Two threads, f32.
fn engine(weights: &Weights, kind: EngineKind) -> Engine {
    let options = EngineOptions { kind, dtype: Some(Dtype::F32), threads: Some(2) };
    Engine::new(weights, options).unwrap()
}

/// Motion of the codes, a frame at a time.
fn decoded(weights: &Weights, kind: EngineKind, codes: &[Vec<usize>]) -> Vec<f32> {
    let engine = engine(weights, kind);
    let decoder = VqDecoder::load(weights, &engine).unwrap();
    let mut state = decoder.start();
    let team = engine.pool().team();
    let mut step = |codes: &Vec<usize>| decoder.step(&team, &mut state, codes).unwrap().to_vec();
    codes.iter().flat_map(&mut step).collect()
}

/// Hidden vectors of each lane, a frame at a time; lane 1 hears nothing.
fn hidden(
    weights: &Weights,
    kind: EngineKind,
    previous: &[Vec<usize>],
    music: &[f32],
    lanes: usize,
) -> [Vec<f32>; 2] {
    let engine = engine(weights, kind);
    let seq = MotionSeq::load(weights, &engine).unwrap();
    let mut state = seq.start(lanes);
    seq.set_style(&mut state, seq.style(STYLE));
    let team = engine.pool().team();
    let mut found = [Vec::new(), Vec::new()];
    for (codes, music) in previous.iter().zip(music.chunks(39)) {
        seq.step(&team, &mut state, codes, &[Some(music), None][..lanes]).unwrap();
        for (lane, found) in found.iter_mut().enumerate().take(lanes) {
            found.extend(state.hidden(lane));
        }
    }
    found
}
