//! `servodance ablate`.

use super::{INTERRUPTED, stop_signal};
use servodance_runtime::process::console::{stderr_line, stdout_line};
use servodance_training::ablate::{AblationRequest, ablate};
use std::path::PathBuf;
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
    /// Settings of the whole model.
    #[arg(long, value_name = "FILE.toml")]
    pub config: PathBuf,
    #[arg(help = "The training file", long, value_name = "FILE.safetensors")]
    pub data: PathBuf,
    /// The same built with `--music-features encodec128`, for the variant
    /// that hears Encodec latents.
    #[arg(long, value_name = "FILE.safetensors")]
    pub latents: Option<PathBuf>,
    /// The Encodec that these latents are of, if it is not in
    /// servodance/encodec_24khz in the user's data folder.
    #[arg(long, value_name = "FILE.safetensors", requires = "latents")]
    pub encodec: Option<PathBuf>,
    /// The folder to write to; a run that was stopped there goes on.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Only this variant beside the whole model; may be given several times.
    #[arg(long, value_name = "VARIANT")]
    pub only: Vec<String>,
    /// How often everything is danced anew.
    #[arg(long, default_value_t = 5, value_name = "N")]
    pub repeats: usize,
    /// Clips of music danced to in each repeat.
    #[arg(long, default_value_t = 8, value_name = "N")]
    pub clips: usize,
    /// Threads to train with.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Print only errors and the table.
    #[arg(long, short)]
    pub quiet: bool,
}

/// Trains, scores, prints the table.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let stop = stop_signal()?;
    let request = AblationRequest {
        config: args.config,
        data: args.data,
        latents: args.latents,
        encodec: args.encodec,
        out: args.out,
        only: args.only,
        repeats: args.repeats,
        clips: args.clips,
        threads: args.threads,
        quiet: args.quiet,
    };
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
