//! `servodance ablate`.

use super::{INTERRUPTED, stop_signal};
use servodance_runtime::process::console::{stderr_line, stdout_line};
use servodance_training::ablate::{AblationRequest, ablate};
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  servodance dataset build data.safetensors --motion data --songs 4 --choreography 90
  servodance ablate --config train.toml --data data.safetensors --out ablation
      the whole model, then without ALiBi, style, alignment, codebook tricks, body parts
  servodance ablate --config train.toml --data data.safetensors --out ablation --only no-style
      one comparison; what is there already is not trained again
  servodance ablate --config train.toml --data data.safetensors --latents data.safetensors \
    --encodec encodec_24khz/model.safetensors --out ablation
      with Encodec, on data built with --music-features encodec128

train.toml is the settings file of `servodance train` (docs/training.md): its
steps are the budget of each variant. In OUT: a folder a variant, ablation.csv,
ablation.png.";

/// What `ablate` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    request: AblationRequest,
}

/// Trains, scores, prints the table.
pub fn run(Args { request }: Args) -> anyhow::Result<ExitCode> {
    let stop = stop_signal()?;
    let Some(table) = ablate(&request, &stop)? else {
        stderr_line!("stopped; the same command goes on from here");
        return Ok(ExitCode::from(INTERRUPTED));
    };
    servodance_runtime::process::console::stdout(format_args!("{}", table.text()));
    if !request.quiet {
        stdout_line!("\n{}", request.out.join("ablation.png").display());
    }
    Ok(ExitCode::SUCCESS)
}
