//! What `servodance train` is asked for.

use crate::train::TrainedNetwork;
use std::path::PathBuf;

/// One run of `servodance train`; values here take precedence over the file.
#[derive(Clone, Debug, clap::Args)]
pub struct TrainingRequest {
    /// Which of the two networks; the command line sets it by its subcommand.
    #[arg(skip = TrainedNetwork::VqVae)]
    pub network: TrainedNetwork,
    /// The settings
    #[arg(long, value_name = "FILE.toml")]
    pub config: PathBuf,
    /// The training file, in place of that in the settings.
    #[arg(long, value_name = "FILE.safetensors")]
    pub data: Option<PathBuf>,
    /// The folder to write to, in place of that in the settings.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Everything random follows from it.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Threads to work with; they change no number.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Stop when so many steps are taken, to go on later.
    #[arg(long, value_name = "STEP")]
    pub until: Option<u64>,
    /// Go on from the checkpoint in the folder, to the same bytes as if it
    /// had never been stopped.
    #[arg(long)]
    pub resume: bool,
    /// Print only errors
    #[arg(long, short)]
    pub quiet: bool,
    /// Weights of stage 1: `vqvae` begins with them (random ones if left out), `motionseq` builds
    /// on them (OUT/vqvae/weights.safetensors if left out).
    #[arg(long = "stage-one", value_name = "FILE.safetensors")]
    pub vqvae_weights: Option<PathBuf>,
}
