//! Gradients against differences of the loss.

use rand::Rng;

use super::super::network_training::BatchOutcome;
use super::{check_same, motion_batch, motionseq_training, rng, seq_batch, vqvae_training};
use crate::train::autodiff::parameters::{ParameterGradients, Parameters, normal};
use crate::train::autodiff::tape::Batch;
use crate::train::vqvae::training::MotionBatch;
use servodance_model::config::Positions;
use servodance_model::motion::representation::POSE_DIM;

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
        let length = gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
        assert!(length > 1e-7, "{name} got no gradient: {length}");
        let mut directions = vec![gradient.clone()];
        directions.push((0..gradient.len()).map(|_| normal(&mut rng)).collect());
        for _ in 0..2 {
            let mut single = vec![0.0; gradient.len()];
            single[rng.random_range(0..gradient.len())] = 1.0;
            directions.push(single);
        }
        for direction in directions {
            let norm = direction.iter().map(|d| f64::from(*d).powi(2)).sum::<f64>().sqrt();
            let unit: Vec<f32> = direction.iter().map(|d| (f64::from(*d) / norm) as f32).collect();
            let expected: f64 = unit.iter().zip(gradient).map(|(u, g)| f64::from(u * g)).sum();
            let mut at = |step: f32| {
                let before = parameters.iter().nth(p).unwrap().values.clone();
                let values = &mut parameters.iter_mut().nth(p).unwrap().values;
                values.iter_mut().zip(&unit).for_each(|(v, u)| *v += step * u);
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
    let mut stage = vqvae_training();
    let batch = motion_batch(&[14, 9], 14);
    let BatchOutcome { gradients, .. } = stage.learn(&batch, false, &mut rng());
    let mut parameters = stage.parameters.clone();
    check_gradients(&mut parameters, &gradients, |moved| {
        stage.parameters = moved.clone();
        stage.learn(&batch, false, &mut rng()).terms[0].1
    });
}

#[test]
fn with_codes_every_parameter_of_stage_one_learns() {
    let mut stage = vqvae_training();
    let outcome = stage.learn(&motion_batch(&[14, 9], 14), true, &mut rng());
    for (parameter, gradient) in stage.parameters.iter().zip(&outcome.gradients.0) {
        assert!(gradient.iter().any(|g| g.abs() > 1e-8), "{}", parameter.name);
    }
}

#[test]
fn every_gradient_of_stage_two_is_that_of_the_loss() {
    for positions in [Positions::Alibi, Positions::Sinusoidal] {
        let mut stage = motionseq_training(positions);
        let batch = seq_batch(&[12, 12, 7], 12);
        let BatchOutcome { gradients, .. } = stage.learn(&batch, &mut rng());
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
        batch: Batch { length: 14, lengths: vec![9] },
    };
    let [a, b] = [&second, &padded].map(|batch| vqvae_training().learn(batch, true, &mut rng()));
    assert!((a.terms[0].1 - b.terms[0].1).abs() < 1e-5 * a.terms[0].1.abs());
    for (a, b) in a.gradients.0.iter().zip(&b.gradients.0) {
        check_same("gradient", a, b);
    }
}
