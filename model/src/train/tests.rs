//! Both stages whole: against the networks that run, against the twin, against
//! differences, and against themselves when stopped and continued.
//!
//! `golden/` is written by `model/reference/golden_step.py`: one training step
//! of the twin from the weights in `net/golden/tiny.safetensors`.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::checkpoint;
use super::codebook::Codebook;
use super::data::tests::data;
use super::layers::Dropout;
use super::motion_loss::MotionLoss;
use super::motionseq::Inputs;
use super::optimizer::{AdamSettings, AdamW};
use super::parameters::{ParameterGradients, Parameters};
use super::settings::{Settings, SettingsFile, StageKind};
use super::stage1::{MotionBatch, VqStage};
use super::stage2::{SeqBatch, SeqStage, StageOne};
use super::tape::{Batch, Buffers, Tape};
use super::tensors::{Numbers, Tensors, read};
use super::trainer::{Outcome, Trainer};
use super::vqvae::embed;
use crate::motion::representation::POSE_DIM;
use crate::net::absolute_tests;
use crate::net::{OneShotDecoder, OneShotSeq, Positions, SeqConfig, VqEncoder, Weights};

const TINY: &[u8] = include_bytes!("../net/golden/tiny.safetensors");
const GOLDEN: &[u8] = include_bytes!("golden/step.safetensors");
const ABSOLUTE: &[u8] = include_bytes!("golden/absolute.safetensors");
const TOLERANCE: f32 = 1e-4;

fn rng() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(2)
}

fn settings(stage: StageKind, change: impl FnOnce(&mut SettingsFile)) -> Settings {
    let mut file = SettingsFile {
        preset: super::Preset::Tiny,
        ..SettingsFile::default()
    };
    file.quantise.noise = 0.0;
    change(&mut file);
    file.resolve(stage).unwrap()
}

/// Stage 1 with the tiny weights.
fn stage_one() -> VqStage {
    let mut stage = VqStage::new(settings(StageKind::VqVae, |_| ()), data(), &mut rng()).unwrap();
    let tiny = read(TINY, &["vq.", "norm."]).unwrap();
    load(&mut stage.parameters, &tiny);
    stage.books = ["lower", "upper"].map(|part| book(&tiny, part)).to_vec();
    stage.ready = true;
    let norm = |name: &str| floats(&tiny, &format!("norm.motion_{name}"));
    let weights = super::LossWeights {
        position: 0.5,
        ..Default::default()
    };
    stage.loss = MotionLoss::new(norm("mean"), norm("std"), weights);
    stage
}

fn book(tensors: &Tensors, part: &str) -> Codebook {
    Codebook::new(floats(tensors, &format!("vq.codebook.{part}")), 8)
}

/// Stage 2 with the tiny weights, whose styles are two.
fn stage_two(positions: Positions) -> SeqStage {
    stage_two_of(TINY, |seq| seq.positions = positions)
}

/// The same with other weights and a change that makes the network theirs.
fn stage_two_of(weights: &[u8], change: impl Fn(&mut SeqConfig)) -> SeqStage {
    let stage_one = StageOne::open(TINY, "tiny").unwrap();
    let mut settings = settings(StageKind::MotionSeq, |_| ());
    let tiny = Weights::open(TINY, "tiny").unwrap();
    settings.model.seq = tiny.config().seq.clone();
    change(&mut settings.model.seq);
    let (mut stage, _) = SeqStage::new(settings, data(), stage_one, &mut rng()).unwrap();
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
        let values = checkpoint::floats(from, &parameter.name, parameter.values.len());
        parameter.values = values.unwrap();
    }
}

fn check_same(what: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let largest = expected.iter().fold(0f32, |m, v| m.max(v.abs()));
    for (i, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!(
            (f - e).abs() <= TOLERANCE * largest.max(1.0),
            "{what}, {i}: {f} and {e}"
        );
    }
}

fn noise(count: usize) -> Vec<f32> {
    let mut rng = rng();
    (0..count)
        .map(|_| super::parameters::normal(&mut rng))
        .collect()
}

fn motion_batch(lengths: &[usize], length: usize) -> MotionBatch {
    let stage = stage_one();
    let batch = Batch {
        length,
        lengths: lengths.to_vec(),
    };
    let real = stage.loss.restored(&noise(batch.rows() * POSE_DIM));
    MotionBatch { real, batch }
}

fn seq_batch(lengths: &[usize], length: usize) -> SeqBatch {
    let mut rng = rng();
    let batch = Batch {
        length,
        lengths: lengths.to_vec(),
    };
    let rows = batch.rows();
    let mut some = || {
        (0..rows)
            .map(|_| rng.random_range(0..16))
            .collect::<Vec<u32>>()
    };
    let chosen = vec![some(), some()];
    let counted = |codes: &Vec<u32>| {
        let real = |r: usize| r % length < lengths[r / length];
        (0..rows)
            .map(|r| {
                if real(r) {
                    codes[r]
                } else {
                    super::nll::IGNORED
                }
            })
            .collect()
    };
    SeqBatch {
        targets: chosen.iter().map(counted).collect(),
        inputs: Inputs {
            previous: vec![some(), some()],
            chosen,
            music: noise(rows * 39),
            has_music: (0..lengths.len()).map(|s| s != 1).collect(),
            styles: (0..lengths.len() as u32).map(|s| s % 3).collect(),
            batch,
        },
    }
}

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

/// A gradient for every parameter, and the right one: along the gradient itself,
/// along a random direction, and in single numbers.
fn check_gradients(
    parameters: &mut Parameters,
    gradients: &ParameterGradients,
    mut loss: impl FnMut(&Parameters) -> f64,
) {
    let mut rng = rng();
    for (p, gradient) in gradients.0.iter().enumerate() {
        let name = parameters.iter().nth(p).unwrap().name.clone();
        let length = gradient
            .iter()
            .map(|g| f64::from(*g).powi(2))
            .sum::<f64>()
            .sqrt();
        assert!(length > 1e-7, "{name} got no gradient: {length}");
        let mut directions = vec![gradient.clone()];
        directions.push(
            (0..gradient.len())
                .map(|_| super::parameters::normal(&mut rng))
                .collect(),
        );
        for _ in 0..2 {
            let mut single = vec![0.0; gradient.len()];
            single[rng.random_range(0..gradient.len())] = 1.0;
            directions.push(single);
        }
        for direction in directions {
            let norm = direction
                .iter()
                .map(|d| f64::from(*d).powi(2))
                .sum::<f64>()
                .sqrt();
            let unit: Vec<f32> = direction
                .iter()
                .map(|d| (f64::from(*d) / norm) as f32)
                .collect();
            let expected: f64 = unit
                .iter()
                .zip(gradient)
                .map(|(u, g)| f64::from(u * g))
                .sum();
            let mut at = |step: f32| {
                let before = parameters.iter().nth(p).unwrap().values.clone();
                let values = &mut parameters.iter_mut().nth(p).unwrap().values;
                values
                    .iter_mut()
                    .zip(&unit)
                    .for_each(|(v, u)| *v += step * u);
                let loss = loss(parameters);
                parameters.iter_mut().nth(p).unwrap().values = before;
                loss
            };
            // The slope of the loss, its curvature taken out.
            let slope =
                |at: &mut dyn FnMut(f32) -> f64, h: f32| (at(h) - at(-h)) / f64::from(2.0 * h);
            let (wide, narrow) = (slope(&mut at, 2e-2), slope(&mut at, 1e-2));
            let found = narrow + (narrow - wide) / 3.0;
            let bound = 2e-2 * expected.abs() + 1e-2 * length + 2e-5;
            assert!(
                (found - expected).abs() < bound,
                "{name}: {found}, expected {expected} of {length}"
            );
        }
    }
}

#[test]
fn every_gradient_of_stage_one_is_that_of_the_loss() {
    let mut stage = stage_one();
    let batch = motion_batch(&[14, 9], 14);
    let Outcome { gradients, .. } = stage.learn(&batch, false, &mut rng());
    let mut parameters = stage.parameters.clone();
    check_gradients(&mut parameters, &gradients, |moved| {
        stage.parameters = moved.clone();
        stage.learn(&batch, false, &mut rng()).terms[0].1
    });
}

#[test]
fn with_codes_every_parameter_of_stage_one_learns() {
    let mut stage = stage_one();
    let outcome = stage.learn(&motion_batch(&[14, 9], 14), true, &mut rng());
    for (parameter, gradient) in stage.parameters.iter().zip(&outcome.gradients.0) {
        assert!(
            gradient.iter().any(|g| g.abs() > 1e-8),
            "{}",
            parameter.name
        );
    }
}

#[test]
fn every_gradient_of_stage_two_is_that_of_the_loss() {
    for positions in [Positions::Alibi, Positions::Sinusoidal] {
        let mut stage = stage_two(positions);
        let batch = seq_batch(&[12, 12, 7], 12);
        let Outcome { gradients, .. } = stage.learn(&batch, &mut rng());
        let mut parameters = stage.parameters.clone();
        check_gradients(&mut parameters, &gradients, |moved| {
            stage.parameters = moved.clone();
            stage.learn(&batch, &mut rng()).terms[0].1
        });
    }
}

#[test]
fn padding_changes_neither_loss_nor_gradient() {
    let all = motion_batch(&[14, 9], 14);
    let second = MotionBatch {
        real: all.real[14 * POSE_DIM..][..9 * POSE_DIM].to_vec(),
        batch: Batch::full(1, 9),
    };
    let padded = MotionBatch {
        real: all.real[14 * POSE_DIM..].to_vec(),
        batch: Batch {
            length: 14,
            lengths: vec![9],
        },
    };
    let [a, b] = [&second, &padded].map(|batch| stage_one().learn(batch, true, &mut rng()));
    assert!((a.terms[0].1 - b.terms[0].1).abs() < 1e-5 * a.terms[0].1.abs());
    for (a, b) in a.gradients.0.iter().zip(&b.gradients.0) {
        check_same("gradient", a, b);
    }
}

/// One step of AdamW as the twin takes it.
fn adam_step(parameters: &mut Parameters, gradients: &ParameterGradients) {
    let settings = AdamSettings {
        betas: [0.9, 0.98],
        weight_decay: 0.1,
        clip: 1.0,
    };
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
        let compared = after
            .iter()
            .zip(floats(golden, &format!("after.{name}")))
            .zip(&expected);
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
    let mut stage = stage_one();
    let batch = MotionBatch {
        real: floats(&golden, "in.motion"),
        batch: Batch::full(3, 20),
    };
    let outcome = stage.learn(&batch, true, &mut rng());
    for (name, value) in &outcome.terms[..6] {
        let expected = floats(&golden, &format!("vq.{name}"))[0];
        assert!(
            (*value as f32 - expected).abs() < TOLERANCE * expected.max(1.0),
            "{name}: {value} and {expected}"
        );
    }
    for (part, book) in ["lower", "upper"].iter().zip(&stage.books) {
        let expected = |what: &str| floats(&golden, &format!("book.{part}.{what}"));
        check_same("embed", &book.embed, &expected("embed"));
        check_same("embed_avg", &book.embed_avg, &expected("embed_avg"));
        check_same(
            "cluster_size",
            &book.cluster_size,
            &expected("cluster_size"),
        );
    }
    check_step(&golden, &mut stage.parameters, &outcome.gradients);
}

#[test]
fn a_step_of_stage_two_is_that_of_the_twin() {
    let golden = read(GOLDEN, &[""]).unwrap();
    check_seq_step(&golden, stage_two(Positions::Alibi), |_| ());
}

#[test]
fn a_step_with_absolute_positions_and_an_end_is_that_of_the_twin() {
    let golden = read(ABSOLUTE, &[""]).unwrap();
    let weights = absolute_tests::with_end();
    let stage = stage_two_of(&weights, |seq| {
        (seq.positions, seq.eos) = (Positions::Sinusoidal, true);
    });
    check_seq_step(&golden, stage, |targets| {
        // The first sequence ends with its last frame.
        (targets[0][19], targets[1][19]) = (16, super::nll::IGNORED);
    });
}

/// One step against the golden file's, with targets changed somehow.
fn check_seq_step(golden: &Tensors, mut stage: SeqStage, change: impl Fn(&mut Vec<Vec<u32>>)) {
    let (sequences, length) = (3, 20);
    let lengths: Vec<usize> = codes(golden, "in.lengths")
        .iter()
        .map(|l| *l as usize)
        .collect();
    let of_part = |name: &str, part: usize| -> Vec<u32> {
        codes(golden, name)
            .iter()
            .skip(part)
            .step_by(2)
            .copied()
            .collect()
    };
    let [previous, chosen] =
        ["in.previous", "in.target"].map(|name| vec![of_part(name, 0), of_part(name, 1)]);
    let counted = |codes: &Vec<u32>| {
        let real = |r: usize| r % length < lengths[r / length];
        let target = |r: usize| {
            if real(r) {
                codes[r]
            } else {
                super::nll::IGNORED
            }
        };
        (0..sequences * length).map(target).collect()
    };
    let mut batch = SeqBatch {
        targets: chosen.iter().map(counted).collect(),
        inputs: Inputs {
            previous,
            chosen,
            music: floats(golden, "in.music"),
            has_music: codes(golden, "in.has_music")
                .iter()
                .map(|h| *h == 1)
                .collect(),
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

fn trainer(stage: StageKind, change: impl Fn(&mut SettingsFile)) -> Trainer {
    let settings = settings(stage, |file| {
        for part in [&mut file.vqvae, &mut file.motionseq] {
            part.steps = Some(12);
            part.report = Some(4);
            part.dropout = Some(0.1);
        }
        file.quantise = super::QuantiseSettings {
            free_steps: 4,
            noise: 0.2,
        };
        change(file);
    });
    let stage_one = (stage == StageKind::MotionSeq).then(|| StageOne::open(TINY, "tiny").unwrap());
    Trainer::new(settings, data(), stage_one).unwrap()
}

fn go(trainer: &mut Trainer, until: u64) {
    while trainer.steps_taken() < until {
        trainer.step().unwrap();
        if trainer.line_is_due() {
            trainer.line();
        }
    }
}

#[test]
fn a_run_that_was_stopped_goes_on_to_the_same_bytes() {
    for stage in [StageKind::VqVae, StageKind::MotionSeq] {
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
            assert!(
                second.checkpoint() == straight.checkpoint(),
                "{stage:?}, stopped at {stop}"
            );
            assert!(
                second.weights() == straight.weights(),
                "{stage:?}, stopped at {stop}"
            );
        }
        // And it is no run that never changes.
        let mut other = trainer(stage, |file| file.seed = Some(9));
        go(&mut other, 12);
        assert!(other.weights() != straight.weights());
    }
}

#[test]
fn the_number_of_threads_changes_no_bit_of_a_run() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mut trainer = trainer(StageKind::VqVae, |_| ());
            go(&mut trainer, 8);
            trainer.checkpoint()
        })
    };
    assert!(run(1) == run(3));
}

#[test]
fn a_checkpoint_of_another_run_is_refused_by_what_differs() {
    let bytes = trainer(StageKind::VqVae, |_| ()).checkpoint();
    let error = |change: &dyn Fn(&mut SettingsFile)| {
        let mut other = trainer(StageKind::VqVae, change);
        other.resume(&bytes).unwrap_err().to_string()
    };
    let text = error(&|file| file.vqvae.batch = Some(5));
    assert!(text.contains("`run.batch` is 4, expected 5"), "{text}");
    let text = error(&|file| file.model.codes = Some(32));
    assert!(text.contains("`model.codes` is 16, expected 32"), "{text}");
    let mut other = trainer(StageKind::MotionSeq, |_| ());
    let text = other.resume(&bytes).unwrap_err().to_string();
    assert!(text.contains("is") && text.contains("expected"), "{text}");
    let text = trainer(StageKind::VqVae, |_| ())
        .resume(&bytes[..2000])
        .unwrap_err()
        .to_string();
    assert!(text.contains("not a whole checkpoint"), "{text}");
}

#[test]
fn learning_goes_on_only_while_it_helps() {
    // A rate that moves nothing: no line is better than the first.
    let mut idle = trainer(StageKind::MotionSeq, |file| {
        file.motionseq.learning_rate = Some(1e-30);
        file.motionseq.weight_decay = Some(0.0);
        file.motionseq.patience = Some(2);
        file.motionseq.report = Some(1);
    });
    let mut lines = Vec::new();
    for _ in 0..3 {
        idle.step().unwrap();
        lines.push(idle.line());
    }
    let found: Vec<(bool, bool)> = lines.iter().map(|line| (line.best, line.stale)).collect();
    assert_eq!(found, [(true, false), (false, false), (false, true)]);
}

#[test]
fn what_was_learned_loads_and_the_end_is_learned_where_sequences_end() {
    let mut stage = trainer(StageKind::VqVae, |_| ());
    go(&mut stage, 12);
    let weights = stage.weights();
    let opened = Weights::open(&weights, "trained").unwrap();
    VqEncoder::load(&opened).unwrap();
    OneShotDecoder::load(&opened).unwrap();
    let settings = settings(StageKind::MotionSeq, |file| {
        file.model.eos = Some(true);
        file.motionseq.steps = Some(4);
    });
    let stage_one = StageOne::open(&weights, "trained").unwrap();
    let mut rng = rng();
    let (stage, _) = SeqStage::new(settings.clone(), data(), stage_one.clone(), &mut rng).unwrap();
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
                assert_eq!(targets[1][r], super::nll::IGNORED);
            }
        }
    }
    assert!(ends > 5 && ends < rows / 20, "{ends} of {rows}");
    let mut trainer = Trainer::new(settings, data(), Some(stage_one)).unwrap();
    go(&mut trainer, 4);
    let weights = trainer.weights();
    OneShotSeq::load(&Weights::open(&weights, "trained").unwrap()).unwrap();
    crate::Generator::from_bytes(&weights, "trained").unwrap();
}

#[test]
fn validation_leaves_the_run_as_it_is() {
    for stage in [StageKind::VqVae, StageKind::MotionSeq] {
        let mut run = trainer(stage, |_| ());
        go(&mut run, 5);
        let before = run.weights();
        let scores = |trainer: &mut Trainer| {
            let mut rng = rng();
            trainer.stage_mut().validate(&mut rng).unwrap()
        };
        assert_eq!(scores(&mut run), scores(&mut run));
        assert!(run.weights() == before);
    }
}
