//! `servodance song`.

use servodance_runtime::offline::song_file::write_demo;
use servodance_runtime::process::console::stdout_line;
use std::path::PathBuf;
use std::process::ExitCode;

const EXAMPLES: &str = include_str!("examples/song.txt").trim_ascii_end();

/// What `song` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The file to write.
    #[arg(long, default_value = "servodance-song.wav", value_name = "FILE.wav")]
    pub out: PathBuf,
}

/// Writes the built-in song and prints where.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    write_demo(&args.out)?;
    stdout_line!("{}", args.out.display());
    Ok(ExitCode::SUCCESS)
}
