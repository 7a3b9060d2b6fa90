//! What `servodance train` is asked for.

use crate::train::TrainedNetwork;
use std::path::PathBuf;

/// One run of `servodance train`; values here take precedence over the file.
#[derive(Clone, Debug)]
#[allow(missing_docs)] // explained by `servodance train vqvae --help`
pub struct TrainingRequest {
    pub network: TrainedNetwork,
    pub config: PathBuf,
    pub data: Option<PathBuf>,
    pub out: Option<PathBuf>,
    pub vqvae_weights: Option<PathBuf>,
    pub seed: Option<u64>,
    pub threads: Option<usize>,
    /// Stop, to go on later, when so many steps are taken.
    pub until: Option<u64>,
    pub resume: bool,
    pub quiet: bool,
}
