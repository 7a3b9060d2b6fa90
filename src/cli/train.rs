//! `servodance train`: vqvae, motionseq.

use super::{INTERRUPTED, stop_signal};
use clap::Subcommand;
use servodance_runtime::process::console::{stderr_line, stdout_line};
use servodance_training::runs::{RunEnd, RunOutcome, TrainingRequest, train};
use servodance_training::train::TrainedNetwork;
use std::path::PathBuf;
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  servodance dataset build data.safetensors --motion data --songs 4 --choreography 90
  servodance train vqvae --config train.toml       motion to codes and back
  servodance train motionseq --config train.toml   codes from music
  servodance generate song.ogg --model runs/live/motionseq/weights.safetensors --out dance.npz
  servodance train motionseq --config train.toml --resume   after Ctrl-C

train.toml, every key of which is in docs/training.md:
  preset = \"live\"              # live, paper or tiny
  data = \"data.safetensors\"
  out = \"runs/live\"            # seen from the folder of this file
  [vqvae]
  steps = 4000
  [motionseq]
  steps = 5000
  batch = 16

In OUT/vqvae and OUT/motionseq: last.safetensors (to go on from),
weights.safetensors (of the best line so far), curves.csv, curves.png.";

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    pub command: TrainCommand,
}

/// One subcommand for each network of the model.
#[derive(Debug, Subcommand)]
pub enum TrainCommand {
    /// Stage 1, the VQ-VAE: motion to one code a body part and frame, and back.
    #[command(after_help = EXAMPLES)]
    Vqvae(TrainingRequest),
    /// Stage 2, MotionSeq: the next codes from the codes before and the music.
    #[command(after_help = EXAMPLES)]
    Motionseq(SeqArgs),
}

/// What `train motionseq` is asked for.
#[derive(Debug, clap::Args)]
pub struct SeqArgs {
    /// The weights of stage 1; OUT/vqvae/weights.safetensors if left out.
    #[arg(long, value_name = "FILE.safetensors")]
    pub stage_one: Option<PathBuf>,
    /// What both stages take.
    #[command(flatten)]
    pub run: TrainingRequest,
}

/// Trains and says where the files are.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let request = match args.command {
        TrainCommand::Vqvae(request) => request,
        TrainCommand::Motionseq(SeqArgs { stage_one, run }) => {
            TrainingRequest { network: TrainedNetwork::MotionSeq, vqvae_weights: stage_one, ..run }
        }
    };
    let stop = stop_signal()?;
    let outcome = train(&request, &stop)?;
    if outcome.end == RunEnd::Stopped {
        stderr_line!("stopped at {}", goes_on(&outcome, &request));
        return Ok(ExitCode::from(INTERRUPTED));
    }
    if !request.quiet {
        stdout_line!("{}", told(&outcome, &request));
    }
    Ok(ExitCode::SUCCESS)
}

fn told(outcome: &RunOutcome, request: &TrainingRequest) -> String {
    let weights = outcome.folder.join("weights.safetensors");
    let weights = weights.display();
    match outcome.end {
        RunEnd::Until => format!("paused at {}", goes_on(outcome, request)),
        RunEnd::Early => {
            format!("{weights}: no improvement any more after {} steps", outcome.steps)
        }
        _ => format!("{weights}: {} steps", outcome.steps),
    }
}

fn goes_on(outcome: &RunOutcome, request: &TrainingRequest) -> String {
    let mut command = format!(
        "servodance train {} --config {}",
        request.network.name(),
        request.config.display()
    );
    let given =
        [("data", &request.data), ("out", &request.out), ("stage-one", &request.vqvae_weights)];
    for (name, path) in given {
        if let Some(path) = path {
            command += &format!(" --{name} {}", path.display());
        }
    }
    if let Some(seed) = request.seed {
        command += &format!(" --seed {seed}");
    }
    format!("step {}; to go on: {command} --resume", outcome.steps)
}
