//! What is learned: named tensors of f32, in the order in which they were made.
//!
//! Names and shapes are those of the weights file, so that what was trained
//! loads in [`servodance_model::weights`] as it is.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ParamId(usize);

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Parameter {
    pub name: String,
    pub shape: Vec<usize>,
    pub values: Vec<f32>,
    /// Whether the optimiser's weight decay shrinks it: matrices of linear layers alone.
    pub decays: bool,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum ParamInit {
    Constant(f32),
    Uniform(f32),
    Normal(f32),
}

impl ParamInit {
    fn draw(self, count: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
        match self {
            ParamInit::Constant(value) => vec![value; count],
            ParamInit::Uniform(bound) => {
                (0..count).map(|_| rng.random_range(-bound..=bound)).collect()
            }
            ParamInit::Normal(deviation) => (0..count).map(|_| deviation * normal(rng)).collect(),
        }
    }
}

/// A number from the standard normal distribution (Box and Muller).
pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f32 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    (radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()) as f32
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Parameters {
    all: Vec<Parameter>,
}

impl Parameters {
    pub fn add(
        &mut self,
        name: String,
        shape: &[usize],
        init: ParamInit,
        decays: bool,
        rng: &mut ChaCha8Rng,
    ) -> ParamId {
        self.all.push(Parameter {
            values: init.draw(shape.iter().product(), rng),
            shape: shape.to_vec(),
            name,
            decays,
        });
        ParamId(self.all.len() - 1)
    }

    pub fn get(&self, id: ParamId) -> &[f32] {
        &self.all[id.0].values
    }

    pub fn iter(&self) -> std::slice::Iter<'_, Parameter> {
        self.all.iter()
    }

    pub fn iter_mut(&mut self) -> std::slice::IterMut<'_, Parameter> {
        self.all.iter_mut()
    }
}

#[derive(Clone, Debug)]
pub(crate) struct ParameterGradients(pub Vec<Vec<f32>>);

impl ParameterGradients {
    pub fn zeros(parameters: &Parameters) -> Self {
        Self(parameters.iter().map(|p| vec![0.0; p.values.len()]).collect())
    }

    pub fn of(&mut self, id: ParamId) -> &mut [f32] {
        &mut self.0[id.0]
    }

    pub fn norm(&self) -> f64 {
        let squares = self.0.iter().map(|g| super::lanes::sum_of_squares(g));
        squares.sum::<f64>().sqrt()
    }
}
