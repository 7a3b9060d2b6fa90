//! `servodance song`.

use crate::cli::options::file_ending::file_of;
use crate::cli::prelude::*;
use servodance_runtime::offline::song_file::write_demo;

const EXAMPLES: &str = include_str!("examples/song.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The file to write.
    #[arg(long, default_value = "servodance-song.wav", value_name = "FILE.wav", value_parser = file_of("wav"))]
    pub out: PathBuf,
}

/// Writes the built-in song and prints where.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    write_demo(&args.out)?;
    stdout_line!("{}", args.out.display());
    Ok(ExitCode::SUCCESS)
}
