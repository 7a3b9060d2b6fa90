//! One training step against the PyTorch twin's.
//!
//! `golden/` is written by `model/reference/golden_step.py`: one training step
//! of the twin from the weights in `tests/golden/tiny.safetensors`.

use super::super::optimizer::{AdamSettings, AdamW};
use super::super::tensors::{Tensors, read};
use super::{
    CODES_A_FRAME, TINY, TOLERANCE, check_same, codes, floats, motionseq_training,
    motionseq_training_of, rng, vqvae_training,
};
use crate::train::autodiff::parameters::{ParameterGradients, Parameters};
use crate::train::autodiff::tape::Batch;
use crate::train::motionseq::network::MotionSeqInputs;
use crate::train::motionseq::nll::IGNORED;
use crate::train::motionseq::training::{MotionSeqTraining, SeqBatch};
use crate::train::vqvae::training::MotionBatch;
use safetensors::SafeTensors;
use servodance_model::config::Positions;
use servodance_model::weights::tensor_file::{self, Entry};
use std::collections::BTreeMap;

const GOLDEN: &[u8] = include_bytes!("../golden/step.safetensors");
const ABSOLUTE: &[u8] = include_bytes!("../golden/absolute.safetensors");

/// One step of AdamW as the twin takes it.
fn adam_step(parameters: &mut Parameters, gradients: &ParameterGradients) {
    let settings = AdamSettings { betas: [0.9, 0.98], weight_decay: 0.1, clip: 1.0 };
    AdamW::new(parameters).step(parameters, gradients, 1e-3, &settings);
}

/// Gradients and stepped parameters against those of the twin, every fifth
/// number of each.
fn check_step(golden: &Tensors, parameters: &mut Parameters, gradients: &ParameterGradients) {
    let sampled = |values: &[f32]| values.iter().step_by(5).copied().collect::<Vec<f32>>();
    adam_step(parameters, gradients);
    for (parameter, gradient) in parameters.iter().zip(&gradients.0) {
        let name = &parameter.name;
        let expected = floats(golden, &format!("gradient.{name}"));
        check_same(name, &sampled(gradient), &expected);
        let after = sampled(&parameter.values);
        let compared = after.iter().zip(floats(golden, &format!("after.{name}"))).zip(&expected);
        for (i, ((found, wanted), g)) in compared.enumerate() {
            // The first step has the size of the learning rate whatever the
            // gradient: where that is rounding error, so is the direction.
            assert!(
                (found - wanted).abs() < TOLERANCE || g.abs() < 1e-5,
                "{name}, {i}: {found} and {wanted}"
            );
        }
    }
}

#[test]
fn a_step_of_stage_one_is_that_of_the_twin() {
    let golden = read(GOLDEN, &[""]).unwrap();
    let mut stage = vqvae_training();
    let batch = MotionBatch { real: floats(&golden, "in.motion"), batch: Batch::full(3, 20) };
    let outcome = stage.learn(&batch, true, &mut rng());
    for (name, value) in &outcome.terms[..6] {
        let expected = floats(&golden, &format!("vq.{name}"))[0];
        assert!(
            (*value as f32 - expected).abs() < TOLERANCE * expected.max(1.0),
            "{name}: {value} and {expected}"
        );
    }
    let books = stage.books.iter().flat_map(|books| &books.0);
    for (name, book) in ["lower", "lower_2", "upper"].iter().zip(books) {
        let expected = |what: &str| floats(&golden, &format!("book.{name}.{what}"));
        check_same("embed", &book.embed, &expected("embed"));
        check_same("embed_avg", &book.embed_avg, &expected("embed_avg"));
        check_same("cluster_size", &book.cluster_size, &expected("cluster_size"));
    }
    check_step(&golden, &mut stage.parameters, &outcome.gradients);
}

#[test]
fn a_step_of_stage_two_is_that_of_the_twin() {
    let golden = read(GOLDEN, &[""]).unwrap();
    check_seq_step(&golden, motionseq_training(Positions::Alibi), |_| ());
}

#[test]
fn a_step_with_absolute_positions_and_an_end_is_that_of_the_twin() {
    let golden = read(ABSOLUTE, &[""]).unwrap();
    let weights = with_end();
    let stage = motionseq_training_of(&weights, |seq| {
        (seq.positions, seq.eos) = (Positions::Sinusoidal, true);
    });
    check_seq_step(&golden, stage, |targets| {
        // The first sequence ends with its last frame.
        targets[0][19] = 16;
        targets[1..].iter_mut().for_each(|of_code| of_code[19] = IGNORED);
    });
}

/// One step against the golden file's, with targets changed somehow.
fn check_seq_step(
    golden: &Tensors,
    mut stage: MotionSeqTraining,
    change: impl Fn(&mut Vec<Vec<u32>>),
) {
    let (sequences, length) = (3, 20);
    let lengths: Vec<usize> = codes(golden, "in.lengths").iter().map(|l| *l as usize).collect();
    let of_part = |name: &str, part: usize| -> Vec<u32> {
        codes(golden, name).iter().skip(part).step_by(CODES_A_FRAME).copied().collect()
    };
    let [previous, chosen]: [Vec<Vec<u32>>; 2] = ["in.previous", "in.target"]
        .map(|name| (0..CODES_A_FRAME).map(|i| of_part(name, i)).collect());
    let counted = |codes: &Vec<u32>| {
        let real = |r: usize| r % length < lengths[r / length];
        let target = |r: usize| {
            if real(r) { codes[r] } else { IGNORED }
        };
        (0..sequences * length).map(target).collect()
    };
    let mut batch = SeqBatch {
        targets: chosen.iter().map(counted).collect(),
        inputs: MotionSeqInputs {
            previous,
            chosen,
            music: floats(golden, "in.music"),
            has_music: codes(golden, "in.has_music").iter().map(|h| *h == 1).collect(),
            styles: codes(golden, "in.style"),
            batch: Batch { length, lengths },
        },
    };
    change(&mut batch.targets);
    let outcome = stage.learn(&batch, &mut rng());
    let expected = floats(golden, "seq.loss")[0];
    assert!(
        (outcome.terms[0].1 as f32 - expected).abs() < TOLERANCE * expected,
        "{:?}",
        outcome.terms
    );
    check_step(golden, &mut stage.parameters, &outcome.gradients);
}

/// The tiny model with absolute positions and one row more in its first head.
fn with_end() -> Vec<u8> {
    let tensors = SafeTensors::deserialize(TINY).unwrap();
    let (_, header) = SafeTensors::read_metadata(TINY).unwrap();
    let mut metadata: BTreeMap<String, String> =
        header.metadata().clone().unwrap().into_iter().collect();
    let config = metadata.get_mut("config").unwrap();
    let more = r#""eos":true,"positions":"sinusoidal","music_at_input""#;
    *config = config.replace(r#""music_at_input""#, more);
    let tensors = tensors.tensors().into_iter().map(|(name, view)| {
        let (mut shape, mut data) = (view.shape().to_vec(), view.data().to_vec());
        if name == "seq.head.lower.weight" {
            shape[0] += 1;
            let row = (0..shape[1]).map(|k| (0.2 * (k as f64).sin()) as f32);
            data.extend(row.flat_map(f32::to_le_bytes));
        } else if name == "seq.head.lower.bias" {
            shape[0] += 1;
            data.extend(0.5f32.to_le_bytes());
        }
        (name, view.dtype(), shape, data)
    });
    let tensors: Vec<_> = tensors.collect();
    let entries =
        tensors.iter().map(|(name, dtype, shape, data)| Entry { name, dtype: *dtype, shape, data });
    tensor_file::bytes(&metadata, entries.collect())
}
