//! What `servodance evaluate` is asked for.

use servodance_model::GeneratorOptions;
use servodance_model::engine::EngineOptions;
use std::path::PathBuf;

/// Which weights to evaluate, against which reference, how thoroughly.
#[derive(Clone, Debug)]
#[allow(missing_docs)] // explained by `servodance evaluate --help`
pub struct EvaluationRequest {
    /// A training file with held-out dance; choreography if left out.
    pub data: Option<PathBuf>,
    pub model: Option<PathBuf>,
    /// Weights, for a model that hears through Encodec, if they are not in the data folder.
    pub encodec: Option<PathBuf>,
    /// One style for all; that of each clip if left out.
    pub style: Option<String>,
    pub repeats: usize,
    /// HumanML3D's folder, to score motions against their texts as well.
    pub texts: Option<PathBuf>,
    /// The folder with the T2M extractors for that, if it is not in the user's data folder.
    pub extractors: Option<PathBuf>,
    /// Clips of music danced to in each repeat.
    pub clips: usize,
    pub seconds: f64,
    /// Minutes of one long dance; none if 0.
    pub minutes: usize,
    /// How codes are drawn; its seed and style are not looked at.
    pub sampling: GeneratorOptions,
    pub engine: EngineOptions,
    pub seed: u64,
}

impl EvaluationRequest {
    pub(super) fn options(&self, seed: u64) -> GeneratorOptions {
        GeneratorOptions { seed, style: self.style.clone(), ..self.sampling.clone() }
    }
}
