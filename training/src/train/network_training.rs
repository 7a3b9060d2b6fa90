//! What the trainer needs of a network: batches, gradients, validation, state.

use rand_chacha::ChaCha8Rng;

use super::autodiff::parameters::{ParameterGradients, Parameters};
use super::tensors::Tensors;

/// Numbers with names, in order; the first is to be made small.
pub type NamedValues = Vec<(String, f64)>;

pub(crate) struct BatchOutcome {
    /// Terms of the loss; the first is the loss.
    pub terms: NamedValues,
    pub gradients: ParameterGradients,
}

pub(crate) trait NetworkTraining {
    fn parameters(&mut self) -> &mut Parameters;
    fn step(&mut self, step: u64, rng: &mut ChaCha8Rng) -> BatchOutcome;
    /// Scores on held-out clips; none where none are held out.
    fn validate(&mut self, rng: &mut ChaCha8Rng) -> Option<NamedValues>;
    fn state(&self) -> Tensors;
    fn restore(&mut self, tensors: &Tensors) -> Result<(), String>;
    fn weights(&self) -> Tensors;
    fn default_style(&self) -> usize;
}
