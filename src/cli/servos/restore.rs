//! `servodance servos restore`.

use crate::cli::prelude::*;
use crate::cli::servos::PlacesArgs;
use servodance_runtime::bus_tools::memory;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The file that `servos backup` wrote.
    #[arg(value_name = "FILE.toml")]
    pub file: PathBuf,
    #[command(flatten)]
    pub places: PlacesArgs,
    #[arg(help = "Do not ask", long)]
    pub yes: bool,
}

/// Prints what differs, and a line for each register that was written.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let (places, consent) = (args.places.open()?, Consent::from_flag(args.yes));
    memory::restore(&places, &args.file, consent, |line| stdout_line!("{line}"))?;
    Ok(ExitCode::SUCCESS)
}
