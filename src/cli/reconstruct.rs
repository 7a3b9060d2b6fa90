//! `servodance reconstruct`.

use crate::cli::prelude::*;
use servodance_runtime::offline::generate::{MotionFormat, reconstruct, write_motion};

const EXAMPLES: &str = include_str!("examples/reconstruct.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The motion: .npz with `positions` [T, 22, 3] in metres (y up) and `fps`.
    #[arg(value_name = "MOTION.npz")]
    pub motion: PathBuf,
    /// The file to write: .npz (positions) or .bvh (joint angles).
    #[arg(long, value_name = "FILE.npz|FILE.bvh")]
    pub out: PathBuf,
    /// Also write the original at 20 FPS on the common skeleton, frame by
    /// frame beside the reconstruction.
    #[arg(long, value_name = "FILE.npz|FILE.bvh")]
    pub original: Option<PathBuf>,
    /// Weights to use in place of the built-in ones.
    #[arg(long, value_name = "FILE.safetensors")]
    pub model: Option<PathBuf>,
}

/// Writes the reconstruction and prints its error.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    for path in std::iter::once(&args.out).chain(&args.original) {
        MotionFormat::of(path)?;
    }
    let done = reconstruct(&args.motion, args.model.as_deref())?;
    write_motion(&args.out, &done.reconstructed)?;
    if let Some(path) = &args.original {
        write_motion(path, &done.original)?;
    }
    stdout_line!(
        "{}: {} frames at {} FPS, mean joint error {:.1} mm",
        args.out.display(),
        done.reconstructed.poses.len(),
        done.reconstructed.fps,
        1e3 * done.mpjpe_m
    );
    Ok(ExitCode::SUCCESS)
}
