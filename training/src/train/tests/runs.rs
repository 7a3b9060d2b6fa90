//! Whole runs: stopped and continued, with threads, refused, ended, validated.

use super::super::QuantiseSettings;
use super::super::data::TrainingData;
use super::super::settings::{SettingsFile, TrainedNetwork};
use super::super::trainer::Trainer;
use super::{TINY, rng, settings};
use crate::train::motionseq::nll::IGNORED;
use crate::train::motionseq::training::{MotionSeqTraining, SeqBatch};
use crate::train::vqvae::vqvae_weights::VqVaeWeights;
use safetensors::SafeTensors;
use servodance_model::config::EncoderKind;
use servodance_model::vqvae::VqEncoder;
use servodance_model::weights::Weights;

fn trainer(stage: TrainedNetwork, change: impl Fn(&mut SettingsFile)) -> Trainer {
    let settings = settings(stage, |file| {
        for part in [&mut file.vqvae, &mut file.motionseq] {
            part.steps = Some(12);
            part.report = Some(4);
            part.dropout = Some(0.1);
        }
        file.quantise = QuantiseSettings { free_steps: 4, noise: 0.2 };
        change(file);
    });
    let vqvae_training =
        (stage == TrainedNetwork::MotionSeq).then(|| VqVaeWeights::open(TINY, "tiny").unwrap());
    Trainer::new(settings, TrainingData::example(), vqvae_training).unwrap()
}

fn go(trainer: &mut Trainer, until: u64) {
    while trainer.steps_taken() < until {
        trainer.step().unwrap();
        if trainer.curve_row_is_due() {
            trainer.curve_row();
        }
    }
}

#[test]
fn a_run_that_was_stopped_goes_on_to_the_same_bytes() {
    for stage in [TrainedNetwork::VqVae, TrainedNetwork::MotionSeq] {
        let mut straight = trainer(stage, |_| ());
        go(&mut straight, 12);
        for stop in [2, 4, 7] {
            let mut first = trainer(stage, |_| ());
            go(&mut first, stop);
            let bytes = first.checkpoint();
            let mut second = trainer(stage, |_| ());
            second.resume(&bytes).unwrap();
            assert_eq!(
                second.checkpoint(),
                bytes,
                "{stage:?}: what was read is not what was written"
            );
            go(&mut second, 12);
            assert!(second.checkpoint() == straight.checkpoint(), "{stage:?}, stopped at {stop}");
            assert!(second.weights() == straight.weights(), "{stage:?}, stopped at {stop}");
        }
        // And it is no run that never changes.
        let mut other = trainer(stage, |file| file.seed = Some(9));
        go(&mut other, 12);
        assert!(other.weights() != straight.weights());
    }
}

#[test]
fn fixed_codes_stay_to_the_bit_while_the_decoder_learns() {
    let mut first = trainer(TrainedNetwork::VqVae, |_| ());
    go(&mut first, 12);
    let bytes = first.weights();
    let mut settings = first.settings().clone();
    settings.codebook.fixed = true;
    let weights = VqVaeWeights::open(&bytes, "trained").unwrap();
    let data = TrainingData::example;
    let mut second = Trainer::new(settings.clone(), data(), Some(weights)).unwrap();
    go(&mut second, 12);
    let trained = second.weights();
    let [before, after] = [&bytes, &trained].map(|b| SafeTensors::deserialize(b).unwrap());
    for (name, tensor) in before.tensors() {
        let same = tensor.data() == after.tensor(&name).unwrap().data();
        assert_eq!(same, !name.starts_with("vq.decoder."), "{name}");
    }
    let refused = Trainer::new(settings, data(), None).map(|_| ()).unwrap_err().to_string();
    assert!(refused.contains("stage_one"), "{refused}");
}

#[test]
fn positions_are_quantised_without_an_encoder_as_by_the_networks_that_run() {
    let mut trainer = trainer(TrainedNetwork::VqVae, |file| {
        file.model.encoder = Some(EncoderKind::Positions);
        file.model.parts = Some(["trunk", "left_leg", "right_arm"].map(str::to_owned).to_vec());
        file.model.levels = Some(vec![3, 2, 1]);
        file.model.code_dim = Some(40);
    });
    go(&mut trainer, 12);
    let bytes = trainer.weights();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    assert!(tensors.names().iter().all(|name| !name.starts_with("vq.encoder.")));
    // A level of codes of one part, by hand: the nearest to the positions themselves.
    let floats = |name: &str| -> Vec<f32> {
        let view = tensors.tensor(name).unwrap();
        view.data().as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
    };
    let (mean, std) = (floats("norm.motion_mean"), floats("norm.motion_std"));
    let motion: Vec<[f32; 137]> = TrainingData::example().clips[0].motion[..40]
        .iter()
        .map(|row| std::array::from_fn(|c| (row[c] - mean[c]) / std[c]))
        .collect();
    let encoder = VqEncoder::load(&Weights::open(&bytes, "trained").unwrap()).unwrap();
    let found = encoder.encode(&motion).unwrap();
    let book = floats("vq.codebook.right_arm");
    let elbow_and_wrist = [19, 21].map(|joint| 4 + 3 * (joint - 1)).into_iter();
    let channels: Vec<usize> = elbow_and_wrist.flat_map(|at| at..at + 3).collect();
    for (row, codes) in motion.iter().zip(&found) {
        let distance = |code: &usize| -> f32 {
            let vector = &book[code * 40..][..6];
            channels.iter().zip(vector).map(|(c, v)| (row[*c] - v).powi(2)).sum()
        };
        let nearest = (0..16).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
        assert!((distance(&codes[2]) - distance(&nearest)).abs() < 1e-4);
    }
    assert!(found.iter().any(|codes| codes[2] != found[0][2]));
}

#[test]
fn a_run_begins_with_trained_weights_and_is_another_run() {
    let mut first = trainer(TrainedNetwork::VqVae, |_| ());
    go(&mut first, 12);
    let (bytes, settings) = (first.weights(), first.settings().clone());
    let begin = || {
        let weights = VqVaeWeights::open(&bytes, "trained").unwrap();
        Trainer::new(settings.clone(), TrainingData::example(), Some(weights)).unwrap()
    };
    let mut second = begin();
    let score = |trainer: &mut Trainer| trainer.training.validate(&mut rng()).unwrap();
    assert_eq!(score(&mut first), score(&mut second));
    go(&mut second, 4);
    assert!(score(&mut first) != score(&mut second));
    let mut third = begin();
    third.resume(&second.checkpoint()).unwrap();
    let text = third.resume(&first.checkpoint()).unwrap_err().to_string();
    assert!(text.contains("stage_one_sha256"), "{text}");
}

#[test]
fn the_number_of_threads_changes_no_bit_of_a_run() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut trainer = trainer(TrainedNetwork::VqVae, |_| ());
            go(&mut trainer, 8);
            trainer.checkpoint()
        })
    };
    assert!(run(1) == run(3));
}

#[test]
fn a_checkpoint_of_another_run_is_refused_by_what_differs() {
    let bytes = trainer(TrainedNetwork::VqVae, |_| ()).checkpoint();
    let error = |change: &dyn Fn(&mut SettingsFile)| {
        let mut other = trainer(TrainedNetwork::VqVae, change);
        other.resume(&bytes).unwrap_err().to_string()
    };
    let text = error(&|file| file.vqvae.batch = Some(5));
    assert!(text.contains("`run.batch` is 4, expected 5"), "{text}");
    let text = error(&|file| file.model.codes = Some(32));
    assert!(text.contains("`model.codes` is 16, expected 32"), "{text}");
    let mut other = trainer(TrainedNetwork::MotionSeq, |_| ());
    let text = other.resume(&bytes).unwrap_err().to_string();
    assert!(text.contains("is") && text.contains("expected"), "{text}");
    let text =
        trainer(TrainedNetwork::VqVae, |_| ()).resume(&bytes[..2000]).unwrap_err().to_string();
    assert!(text.contains("not a whole checkpoint"), "{text}");
}

#[test]
fn learning_goes_on_only_while_it_helps() {
    // A rate that moves nothing: no line is better than the first.
    let mut idle = trainer(TrainedNetwork::MotionSeq, |file| {
        file.motionseq.learning_rate = Some(1e-30);
        file.motionseq.weight_decay = Some(0.0);
        file.motionseq.patience = Some(2);
        file.motionseq.report = Some(1);
    });
    let mut lines = Vec::new();
    for _ in 0..3 {
        idle.step().unwrap();
        lines.push(idle.curve_row());
    }
    let found: Vec<(bool, bool)> = lines.iter().map(|line| (line.best, line.stale)).collect();
    assert_eq!(found, [(true, false), (false, false), (false, true)]);
}

#[test]
fn what_was_learned_loads_and_the_end_is_learned_where_sequences_end() {
    let mut stage = trainer(TrainedNetwork::VqVae, |_| ());
    go(&mut stage, 12);
    let weights = stage.weights();
    let opened = Weights::open(&weights, "trained").unwrap();
    VqEncoder::load(&opened).unwrap();
    servodance_model::Codec::from_bytes(&weights, "trained").unwrap();
    let settings = settings(TrainedNetwork::MotionSeq, |file| {
        file.model.eos = Some(true);
        file.motionseq.steps = Some(4);
    });
    let vqvae_training = VqVaeWeights::open(&weights, "trained").unwrap();
    let mut rng = rng();
    let stage = MotionSeqTraining::new(
        vqvae_training.with_own_sizes(settings.clone()),
        TrainingData::example(),
        vqvae_training.clone(),
        &mut rng,
    )
    .unwrap();
    let (mut ends, mut rows) = (0, 0);
    for _ in 0..200 {
        let SeqBatch { inputs, targets } = stage.draw(&mut rng);
        let length = inputs.batch.length;
        for (r, target) in targets[0].iter().enumerate() {
            rows += 1;
            if *target == 16 {
                ends += 1;
                // The last of its sequence, and the other part has no more to say.
                assert_eq!(r % length + 1, inputs.batch.lengths[r / length]);
                assert_eq!(targets[1][r], IGNORED);
            }
        }
    }
    assert!(ends > 5 && ends < rows / 20, "{ends} of {rows}");
    let mut trainer =
        Trainer::new(settings, TrainingData::example(), Some(vqvae_training)).unwrap();
    go(&mut trainer, 4);
    let weights = trainer.weights();
    servodance_model::Generator::from_bytes(&weights, "trained").unwrap();
}

#[test]
fn validation_leaves_the_run_as_it_is() {
    for stage in [TrainedNetwork::VqVae, TrainedNetwork::MotionSeq] {
        let mut run = trainer(stage, |_| ());
        go(&mut run, 5);
        let before = run.weights();
        let scores = |trainer: &mut Trainer| {
            let mut rng = rng();
            trainer.training.validate(&mut rng).unwrap()
        };
        assert_eq!(scores(&mut run), scores(&mut run));
        assert!(run.weights() == before);
    }
}
