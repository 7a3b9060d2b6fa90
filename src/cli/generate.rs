//! `servodance generate`.

use crate::cli::prelude::*;
use servodance_runtime::offline::generate::{
    GenerateRequest, MotionFormat, generate, write_motion,
};

const EXAMPLES: &str = include_str!("examples/generate.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    request: GenerateRequest,
}

/// Writes the motion and prints what it is.
pub fn run(Args { request }: Args) -> anyhow::Result<ExitCode> {
    MotionFormat::of(&request.out)?;
    let clip = generate(&request)?;
    write_motion(&request.out, &clip)?;
    if !request.quiet {
        stdout_line!(
            "{}: {} frames, {:.2} s at {} FPS",
            request.out.display(),
            clip.poses.len(),
            clip.poses.len() as f64 / clip.fps,
            clip.fps
        );
    }
    Ok(ExitCode::SUCCESS)
}
