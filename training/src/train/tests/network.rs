//! Both stages against the networks that run.

use super::super::layers::Dropout;
use super::{TINY, check_same, motionseq_training, noise, rng, seq_batch, vqvae_training};
use crate::train::autodiff::tape::{Batch, BufferPool, Tape};
use crate::train::vqvae::training::side_by_side;
use servodance_model::config::{CodePlace, Positions};
use servodance_model::engine::{Engine, EngineOptions};
use servodance_model::motion::representation::POSE_DIM;
use servodance_model::motionseq::MotionSeq;
use servodance_model::vqvae::{VqDecoder, VqEncoder};
use servodance_model::weights::{Dtype, Weights};

/// The engine that runs, in f32.
fn engine(weights: &Weights) -> Engine {
    let options = EngineOptions { dtype: Some(Dtype::F32), ..EngineOptions::default() };
    Engine::new(weights, options).unwrap()
}

#[test]
fn stage_one_computes_what_the_networks_that_run_compute() {
    let stage = vqvae_training();
    let weights = Weights::open(TINY, "tiny").unwrap();
    let encoder = VqEncoder::load(&weights).unwrap();
    let engine = engine(&weights);
    let decoder = VqDecoder::load(&weights, &engine).unwrap();
    let frames = 70;
    let normal = noise(frames * POSE_DIM);
    let batch = Batch::full(1, frames);
    let mut t = Tape::new(&stage.parameters, BufferPool::default());
    let mut drop_rng = rng();
    let mut drop = Dropout { rate: 0.0, rng: &mut drop_rng };
    let latents = stage.net.latents(&mut t, &normal, &batch, &mut drop);
    let books = stage.books.iter().zip(latents);
    let found: Vec<Vec<Vec<u32>>> = books.map(|(book, z)| book.nearest(t.data(z))).collect();
    let places = weights.config().code_places();
    let expected = encoder.encode(normal.as_chunks().0).unwrap();
    for (frame, row) in expected.iter().enumerate() {
        let code = |place: &CodePlace| found[place.part][place.level][frame] as usize;
        let found: Vec<usize> = places.iter().map(code).collect();
        assert_eq!(&found, row, "frame {frame}");
    }
    let parts: Vec<Vec<f32>> =
        stage.books.iter().zip(&found).map(|(books, codes)| books.vectors(codes)).collect();
    let vectors = t.constant(side_by_side(&parts, &[8, 8]), 16);
    let out = stage.net.decode(&mut t, vectors, &batch, &mut drop);
    let (team, mut state) = (engine.pool().team(), decoder.start());
    let mut step = |codes: &Vec<usize>| decoder.step(&team, &mut state, codes).unwrap().to_vec();
    let motion: Vec<f32> = expected.iter().flat_map(&mut step).collect();
    check_same("motion", t.data(out), &motion);
}

#[test]
fn stage_two_computes_what_the_networks_that_run_compute() {
    let (stage, frames) = (motionseq_training(Positions::Alibi), 60);
    let weights = Weights::open(TINY, "tiny").unwrap();
    let engine = engine(&weights);
    let (seq, team) = (MotionSeq::load(&weights, &engine).unwrap(), engine.pool().team());
    let batch = seq_batch(&[frames, frames], frames);
    let mut t = Tape::new(&stage.parameters, BufferPool::default());
    let mut drop_rng = rng();
    let mut drop = Dropout { rate: 0.0, rng: &mut drop_rng };
    let logits = stage.net.logits(&mut t, &batch.inputs, &mut drop);
    for s in 0..2 {
        let rows = |codes: &[Vec<u32>]| -> Vec<Vec<usize>> {
            let row = |r: usize| codes.iter().map(|part| part[s * frames + r] as usize).collect();
            (0..frames).map(row).collect()
        };
        // The second has neither music nor the same style.
        let music = batch.inputs.has_music[s].then(|| &batch.inputs.music[..frames * 39]);
        let style = Some(batch.inputs.styles[s] as usize);
        let mut state = seq.start(1);
        seq.set_style(&mut state, seq.style(style));
        let mut expected = vec![Vec::new(); logits.len()];
        let previous = rows(&batch.inputs.previous);
        let chosen = rows(&batch.inputs.chosen);
        for (frame, (previous, chosen)) in previous.iter().zip(&chosen).enumerate() {
            let music = [music.map(|music| &music[39 * frame..][..39])];
            seq.step(&team, &mut state, previous, &music).unwrap();
            for (part, expected) in expected.iter_mut().enumerate() {
                let logits = seq.logits(&team, &mut state, part, chosen).unwrap();
                expected.extend(logits.flatten().copied());
            }
        }
        for (value, expected) in logits.iter().zip(&expected) {
            let wide = t.columns(*value) * frames;
            check_same("logits", &t.data(*value)[s * wide..][..wide], expected);
        }
    }
}
