//! Both stages whole: against the networks that run, against the twin, against
//! differences, and against themselves when stopped and continued. Here is what
//! these tests share: both networks with the tiny weights, and batches for them.

mod gradients;
mod network;
mod runs;
mod twin;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::data::TrainingData;
use super::settings::{SettingsFile, TrainedNetwork, TrainingSettings};
use super::tensors::{Numbers, Tensors, read};
use super::{LossWeights, Preset};
use crate::train::autodiff::parameters::{Parameters, normal};
use crate::train::autodiff::tape::Batch;
use crate::train::motionseq::network::MotionSeqInputs;
use crate::train::motionseq::nll::IGNORED;
use crate::train::motionseq::training::{MotionSeqTraining, SeqBatch};
use crate::train::vqvae::codebook::LearnedCodebook;
use crate::train::vqvae::loss::MotionLoss;
use crate::train::vqvae::residual_codebooks::ResidualCodebooks;
use crate::train::vqvae::training::{MotionBatch, VqVaeTraining};
use crate::train::vqvae::vqvae_weights::VqVaeWeights;
use servodance_model::config::{CodePlace, ModelConfig, Positions, SeqConfig};
use servodance_model::motion::representation::POSE_DIM;
use servodance_model::weights::Weights;

const TINY: &[u8] = include_bytes!("../../../model/src/tests/golden/tiny.safetensors");
const TOLERANCE: f32 = 1e-4;
/// Of the tiny model.
const CODES_A_FRAME: usize = 3;

fn rng() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(2)
}

fn settings(stage: TrainedNetwork, change: impl FnOnce(&mut SettingsFile)) -> TrainingSettings {
    let mut file = SettingsFile { preset: Preset::Tiny, ..SettingsFile::default() };
    file.quantise.noise = 0.0;
    change(&mut file);
    file.resolve(stage).unwrap()
}

/// The VQ-VAE with the tiny weights.
fn vqvae_training() -> VqVaeTraining {
    let mut stage = VqVaeTraining::new(
        settings(TrainedNetwork::VqVae, |_| ()),
        TrainingData::example(),
        None,
        &mut rng(),
    )
    .unwrap();
    let tiny = read(TINY, &["vq.", "norm."]).unwrap();
    load(&mut stage.parameters, &tiny);
    stage.books = (0..2).map(|part| codebooks(&tiny, part)).collect();
    stage.ready = true;
    let norm = |name: &str| floats(&tiny, &format!("norm.motion_{name}"));
    let weights = LossWeights { position: 0.5, ..Default::default() };
    stage.loss = MotionLoss::new(norm("mean"), norm("std"), weights);
    stage
}

fn codebooks(tensors: &Tensors, part: usize) -> ResidualCodebooks {
    let config = ModelConfig::preset("tiny").unwrap();
    let book = |level| {
        let name = config.code_name(CodePlace { part, level });
        LearnedCodebook::new(floats(tensors, &format!("vq.codebook.{name}")), 8)
    };
    ResidualCodebooks((0..config.levels_of(part)).map(book).collect())
}

/// MotionSeq with the tiny weights, whose styles are two.
fn motionseq_training(positions: Positions) -> MotionSeqTraining {
    motionseq_training_of(TINY, |seq| seq.positions = positions)
}

/// The same with other weights and a change that makes the network theirs.
fn motionseq_training_of(weights: &[u8], change: impl Fn(&mut SeqConfig)) -> MotionSeqTraining {
    let vqvae_training = VqVaeWeights::open(TINY, "tiny").unwrap();
    let mut settings = settings(TrainedNetwork::MotionSeq, |_| ());
    let tiny = Weights::open(TINY, "tiny").unwrap();
    settings.model.seq = tiny.config().seq.clone();
    change(&mut settings.model.seq);
    let settings = vqvae_training.with_own_sizes(settings);
    let mut stage =
        MotionSeqTraining::new(settings, TrainingData::example(), vqvae_training, &mut rng())
            .unwrap();
    load(&mut stage.parameters, &read(weights, &["seq."]).unwrap());
    stage
}

fn floats(tensors: &Tensors, name: &str) -> Vec<f32> {
    match &tensors[name].1 {
        Numbers::F32(values) => values.clone(),
        other => panic!("{name}: {other:?}"),
    }
}

fn codes(tensors: &Tensors, name: &str) -> Vec<u32> {
    match &tensors[name].1 {
        Numbers::I32(values) => values.iter().map(|v| *v as u32).collect(),
        other => panic!("{name}: {other:?}"),
    }
}

fn load(parameters: &mut Parameters, from: &Tensors) {
    for parameter in parameters.iter_mut() {
        let values = super::tensors::floats(from, &parameter.name, parameter.values.len());
        parameter.values = values.unwrap();
    }
}

fn check_same(what: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let largest = expected.iter().fold(0f32, |m, v| m.max(v.abs()));
    for (i, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!((f - e).abs() <= TOLERANCE * largest.max(1.0), "{what}, {i}: {f} and {e}");
    }
}

fn noise(count: usize) -> Vec<f32> {
    let mut rng = rng();
    (0..count).map(|_| normal(&mut rng)).collect()
}

fn motion_batch(lengths: &[usize], length: usize) -> MotionBatch {
    let stage = vqvae_training();
    let batch = Batch { length, lengths: lengths.to_vec() };
    let real = stage.loss.restored(&noise(batch.rows() * POSE_DIM));
    MotionBatch { real, batch }
}

fn seq_batch(lengths: &[usize], length: usize) -> SeqBatch {
    let mut rng = rng();
    let batch = Batch { length, lengths: lengths.to_vec() };
    let rows = batch.rows();
    let mut some = || (0..rows).map(|_| rng.random_range(0..16)).collect::<Vec<u32>>();
    let mut of_frame = || (0..CODES_A_FRAME).map(|_| some()).collect::<Vec<_>>();
    let (chosen, previous) = (of_frame(), of_frame());
    let counted = |codes: &Vec<u32>| {
        let real = |r: usize| r % length < lengths[r / length];
        (0..rows).map(|r| if real(r) { codes[r] } else { IGNORED }).collect()
    };
    SeqBatch {
        targets: chosen.iter().map(counted).collect(),
        inputs: MotionSeqInputs {
            previous,
            chosen,
            music: noise(rows * 39),
            has_music: (0..lengths.len()).map(|s| s != 1).collect(),
            styles: (0..lengths.len() as u32).map(|s| s % 3).collect(),
            batch,
        },
    }
}
