//! AdamW, and the clipping of gradients before it.

use rayon::prelude::*;

use crate::train::autodiff::parameters::{ParameterGradients, Parameters};

/// Added to the square root of the second moment, PyTorch's default.
const EPSILON: f32 = 1e-8;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AdamSettings {
    /// Share of the past in the moments.
    pub betas: [f32; 2],
    pub weight_decay: f32,
    /// The longest gradient that is let through as it is.
    pub clip: f32,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AdamW {
    pub first: Vec<Vec<f32>>,
    pub second: Vec<Vec<f32>>,
    pub steps: u64,
}

impl AdamW {
    pub fn new(parameters: &Parameters) -> Self {
        let zeros: Vec<Vec<f32>> = parameters.iter().map(|p| vec![0.0; p.values.len()]).collect();
        Self { first: zeros.clone(), second: zeros, steps: 0 }
    }

    /// Returns the norm before clipping. A norm that is not finite moves nothing.
    pub fn step(
        &mut self,
        parameters: &mut Parameters,
        gradients: &ParameterGradients,
        learning_rate: f32,
        settings: &AdamSettings,
    ) -> f64 {
        let norm = gradients.norm();
        if !norm.is_finite() {
            return norm;
        }
        let shrink = (f64::from(settings.clip) / (norm + 1e-6)).min(1.0) as f32;
        self.steps += 1;
        let [b1, b2] = settings.betas;
        let unbiased = |beta: f32| 1.0 - f64::from(beta).powi(self.steps as i32);
        let rate = (f64::from(learning_rate) / unbiased(b1)) as f32;
        let root = unbiased(b2).sqrt() as f32;
        let moments = self.first.par_iter_mut().zip(self.second.par_iter_mut());
        let all: Vec<_> = parameters.iter_mut().collect();
        all.into_par_iter().zip(&gradients.0).zip(moments).for_each(
            |((parameter, gradient), (first, second))| {
                let decay = if parameter.decays { settings.weight_decay } else { 0.0 };
                let keep = 1.0 - learning_rate * decay;
                for (i, value) in parameter.values.iter_mut().enumerate() {
                    let g = gradient[i] * shrink;
                    first[i] += (1.0 - b1) * (g - first[i]);
                    second[i] = b2 * second[i] + (1.0 - b2) * g * g;
                    *value = *value * keep - rate * first[i] / (second[i].sqrt() / root + EPSILON);
                }
            },
        );
        norm
    }
}

/// Learning rate at a step: linear warm-up, then a cosine down to a fiftieth.
pub(crate) fn learning_rate(peak: f64, step: u64, warm_up: u64, steps: u64) -> f64 {
    const FLOOR: f64 = 0.02;
    let warm = ((step + 1) as f64 / warm_up.max(1) as f64).min(1.0);
    let progress = (step as f64 / steps.max(1) as f64).min(1.0);
    peak * warm * (FLOOR + (1.0 - FLOOR) * 0.5 * (1.0 + (std::f64::consts::PI * progress).cos()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::autodiff::parameters::ParamInit;
    use rand::SeedableRng;

    #[test]
    fn the_first_step_moves_every_number_by_the_learning_rate() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut parameters = Parameters::default();
        parameters.add("a".into(), &[2], ParamInit::Constant(1.0), true, &mut rng);
        parameters.add("b".into(), &[1], ParamInit::Constant(1.0), false, &mut rng);
        let gradients = ParameterGradients(vec![vec![0.3, -0.2], vec![0.1]]);
        let settings = AdamSettings { betas: [0.9, 0.98], weight_decay: 0.5, clip: 1.0 };
        let mut adam = AdamW::new(&parameters);
        let norm = adam.step(&mut parameters, &gradients, 0.01, &settings);
        assert!((norm - 0.14f64.sqrt()).abs() < 1e-6);
        let found: Vec<f32> = parameters.iter().flat_map(|p| p.values.clone()).collect();
        for (f, e) in found.iter().zip([0.995 - 0.01, 0.995 + 0.01, 0.99]) {
            assert!((f - e).abs() < 1e-5, "{found:?}");
        }
        let before = (found, adam.clone());
        let bad = ParameterGradients(vec![vec![f32::NAN, 0.0], vec![0.0]]);
        assert!(adam.step(&mut parameters, &bad, 0.01, &settings).is_nan());
        let after: Vec<f32> = parameters.iter().flat_map(|p| p.values.clone()).collect();
        assert_eq!(before, (after, adam), "a gradient that is no number moved something");
    }

    #[test]
    fn a_long_gradient_is_shortened() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut parameters = Parameters::default();
        parameters.add("a".into(), &[2], ParamInit::Constant(0.0), false, &mut rng);
        let mut adam = AdamW::new(&parameters);
        let settings = AdamSettings { betas: [0.9, 0.98], weight_decay: 0.0, clip: 1.0 };
        let gradients = ParameterGradients(vec![vec![30.0, 40.0]]);
        adam.step(&mut parameters, &gradients, 0.01, &settings);
        assert!((adam.first[0][0] - 0.06).abs() < 1e-5 && (adam.first[0][1] - 0.08).abs() < 1e-5);
    }

    #[test]
    fn the_rate_rises_then_falls_to_its_floor() {
        let at = |step| learning_rate(1.0, step, 10, 100);
        assert!(at(0) < 0.11 && at(4) < at(9) && at(9) > 0.97);
        assert!(at(50) < at(20) && (at(100) - 0.02).abs() < 1e-9);
    }
}
