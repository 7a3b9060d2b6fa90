//! `servodance train`: vqvae, motionseq.

use crate::cli::prelude::*;
use clap::Subcommand;
use servodance_training::runs::{RunEnd, RunOutcome, TrainingRequest, train};
use servodance_training::train::TrainedNetwork;

const EXAMPLES: &str = include_str!("examples/train.txt").trim_ascii_end();

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
    Motionseq(TrainingRequest),
}

/// Trains and says where the files are.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let request = match args.command {
        TrainCommand::Vqvae(request) => request,
        TrainCommand::Motionseq(request) => {
            TrainingRequest { network: TrainedNetwork::MotionSeq, ..request }
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
