//! `servodance song`.

use crate::console::say;
use crate::song::write_demo;
use std::path::PathBuf;
use std::process::ExitCode;

/// What `song` is asked for.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The file to write.
    #[arg(long, default_value = "servodance-song.wav", value_name = "FILE.wav")]
    pub out: PathBuf,
}

/// Writes the built-in song and prints where.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    write_demo(&args.out)?;
    say!("{}", args.out.display());
    Ok(ExitCode::SUCCESS)
}
