//! `servodance generate`.

use servodance_runtime::offline::generate::{
    GenerateRequest, MotionFormat, generate, write_motion,
};
use servodance_runtime::process::console::stdout_line;
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  servodance generate song.ogg --out dance.npz
      positions [T, 22, 3] in metres (y up) and fps, for your own scripts
  servodance generate song.ogg --style salsa --seed 7 --out dance.bvh
      for animation programs
  servodance generate song.ogg --seconds 10 --out a.npz
  servodance generate song.ogg --start a.npz --out b.npz
      a dance that goes on from where another ended
  servodance generate song.ogg --model mine.safetensors --encodec encodec_24khz/model.safetensors --out dance.npz
      weights that hear Encodec latents (see docs/conditioning.md)
  servodance generate song.ogg --model mine.safetensors --style-text \"slow ballet\" --out dance.npz
      a style in words, for weights trained with CLIP's styles";

/// What `generate` is asked for.
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
