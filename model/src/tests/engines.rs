//! The candle engine dances what the own engine dances.
//!
//! Sums in another order move logits by about 1e-5 (f32) or 1e-4 (f16, where a key
//! or value may round to its neighbour; `q8_0`, the built-in format, where the own engine
//! rounds activations to 16 bits as well). A draw that falls that near to the border of two
//! codes takes the other one: measured on fourteen seeds, with f16 after 68 frames or more, with
//! `q8_0` before the 70th in seven dances, with f32 in none of 250 frames each. So those dances
//! are shorter, and their seeds are given.

use servodance_types::{Beat, MusicFrame};

use crate::engine::{EngineKind, EngineOptions};
use crate::{Dance, Dtype, Generator, GeneratorOptions};

fn start(kind: EngineKind, dtype: Option<Dtype>, options: &GeneratorOptions) -> Dance {
    let engine = EngineOptions { kind, dtype, threads: Some(2) };
    let generator = Generator::built_in_with(engine).unwrap();
    generator.start(options.clone()).unwrap()
}

fn music(k: usize) -> MusicFrame {
    let beat = k as f32 * 0.1;
    MusicFrame {
        time_s: k as f64 / 20.0,
        spectral: std::array::from_fn(|i| ((k * 7 + i) as f32 * 0.37).sin() * (1.0 - beat % 1.0)),
        beat: Beat { phase: beat % 1.0, tempo_bpm: 120.0, confidence: 1.0, ..Beat::default() },
        presence: 1.0,
    }
}

/// Codes and the height of the hips of each frame; guidance is left out for a
/// while in between.
fn danced(mut dance: Dance, frames: usize) -> (Vec<Vec<usize>>, Vec<f32>) {
    let step = |k| {
        dance.guide(k % 150 < 120).unwrap();
        let hips_m = dance.step(&music(k)).unwrap().positions[0][1];
        (dance.codes().to_vec(), hips_m)
    };
    (0..frames).map(step).unzip()
}

fn check(dtype: Option<Dtype>, options: &GeneratorOptions, frames: usize) {
    let [own, candle] = EngineKind::ALL.map(|kind| danced(start(kind, dtype, options), frames));
    for (frame, (own, candle)) in own.0.iter().zip(&candle.0).enumerate() {
        assert_eq!(own, candle, "frame {frame}, {dtype:?}, {options:?}");
    }
    for (own, candle) in own.1.iter().zip(&candle.1) {
        assert!((own - candle).abs() < 1e-3, "{own} {candle}");
    }
}

#[test]
fn both_engines_draw_the_same_codes() {
    for seed in [0, 2, 3, 4] {
        let sampled = GeneratorOptions { seed, ..GeneratorOptions::default() };
        check(None, &sampled, 70);
        check(Some(Dtype::F32), &sampled, 250);
    }
    let greedy = GeneratorOptions { temperature: 0.0, ..GeneratorOptions::default() };
    check(None, &greedy, 250);
}

#[test]
fn both_engines_round_weights_alike() {
    let options = GeneratorOptions::default();
    for (dtype, frames) in [(Dtype::F32, 200), (Dtype::F16, 60)] {
        check(Some(dtype), &options, frames);
    }
}
