//! `servodance servos backup`.

use crate::cli::options::file_ending::file_of;
use crate::cli::prelude::*;
use crate::cli::servos::PlacesArgs;
use servodance_runtime::bus_tools::memory;

#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub places: PlacesArgs,
    /// The file to write.
    #[arg(long, value_name = "FILE.toml", value_parser = file_of("toml"))]
    pub out: PathBuf,
    #[arg(help = "Replace a file that is there: an older backup may be all that is left", long)]
    pub force: bool,
}

/// Prints a line for each servo.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    if args.out.exists() && !args.force {
        bail!("{} is there already: another name, or --force", args.out.display());
    }
    memory::back_up(&args.places.open()?, &args.out, |line| stdout_line!("{line}"))?;
    Ok(ExitCode::SUCCESS)
}
