//! Both stages against the networks that run.

use super::super::layers::Dropout;
use super::super::tape::{Batch, Buffers, Tape};
use super::super::vqvae::embed;
use super::{TINY, check_same, noise, rng, seq_batch, stage_one, stage_two};
use servodance_model::motion::representation::POSE_DIM;
use servodance_model::net::{OneShotDecoder, OneShotSeq, Positions, VqEncoder, Weights};

#[test]
fn stage_one_computes_what_the_networks_that_run_compute() {
    let stage = stage_one();
    let weights = Weights::open(TINY, "tiny").unwrap();
    let (encoder, decoder) = (
        VqEncoder::load(&weights).unwrap(),
        OneShotDecoder::load(&weights).unwrap(),
    );
    let frames = 70;
    let normal = noise(frames * POSE_DIM);
    let batch = Batch::full(1, frames);
    let mut t = Tape::new(&stage.parameters, Buffers::default());
    let mut drop_rng = rng();
    let mut drop = Dropout {
        rate: 0.0,
        rng: &mut drop_rng,
    };
    let latents = stage.net.latents(&mut t, &normal, &batch, &mut drop);
    let books = stage.books.iter().zip(latents);
    let found: Vec<Vec<u32>> = books.map(|(book, z)| book.nearest(t.data(z))).collect();
    let expected = encoder.encode(normal.as_chunks().0).unwrap();
    for (frame, row) in expected.iter().enumerate() {
        let found: Vec<usize> = found.iter().map(|part| part[frame] as usize).collect();
        assert_eq!(&found, row, "frame {frame}");
    }
    let vectors = t.constant(embed(&stage.books, &found), 16);
    let out = stage.net.decode(&mut t, vectors, &batch, &mut drop);
    check_same(
        "motion",
        t.data(out),
        &decoder.one_shot(&expected).unwrap().concat(),
    );
}

#[test]
fn stage_two_computes_what_the_networks_that_run_compute() {
    let (stage, frames) = (stage_two(Positions::Alibi), 60);
    let seq = OneShotSeq::load(&Weights::open(TINY, "tiny").unwrap()).unwrap();
    let batch = seq_batch(&[frames, frames], frames);
    let mut t = Tape::new(&stage.parameters, Buffers::default());
    let mut drop_rng = rng();
    let mut drop = Dropout {
        rate: 0.0,
        rng: &mut drop_rng,
    };
    let logits = stage.net.logits(&mut t, &batch.inputs, &mut drop);
    for s in 0..2 {
        let rows = |codes: &[Vec<u32>]| -> Vec<Vec<usize>> {
            let row = |r: usize| {
                codes
                    .iter()
                    .map(|part| part[s * frames + r] as usize)
                    .collect()
            };
            (0..frames).map(row).collect()
        };
        // The second has neither music nor the same style.
        let music = batch.inputs.has_music[s].then(|| &batch.inputs.music[..frames * 39]);
        let style = Some(batch.inputs.styles[s] as usize);
        let hidden = seq
            .one_shot(&rows(&batch.inputs.previous), music, style)
            .unwrap();
        for (part, value) in logits.iter().enumerate() {
            let expected = seq
                .logits(part, &hidden, &rows(&batch.inputs.chosen))
                .unwrap();
            let expected: Vec<f32> = expected.flatten_all().unwrap().to_vec1().unwrap();
            let wide = t.columns(*value) * frames;
            check_same("logits", &t.data(*value)[s * wide..][..wide], &expected);
        }
    }
}
