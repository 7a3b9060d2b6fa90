//! `servodance generate`.

use super::options::engine::{EngineArgs, SamplingArgs};
use servodance_model::{AtEnd, GeneratorOptions};
use servodance_runtime::offline::generate::{
    GenerateRequest, MotionFormat, generate, write_motion,
};
use servodance_runtime::pipeline::audio_input::AudioChoice;
use servodance_runtime::pipeline::conditioning::Conditioning;
use servodance_runtime::process::console::stdout_line;
use std::path::PathBuf;
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
    /// The recording (wav, flac, mp3, ogg); the built-in song if left out.
    #[arg(value_name = "AUDIO")]
    pub audio: Option<PathBuf>,
    /// The file to write: .npz (positions) or .bvh (joint angles).
    #[arg(long, value_name = "FILE.npz|FILE.bvh")]
    pub out: PathBuf,
    /// How much motion; a recording that is shorter is played again.
    #[arg(long, value_name = "SECONDS")]
    pub seconds: Option<f64>,
    /// The same seed and the same input give the same dance.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Dance style; an unknown one lists those that the model knows.
    #[arg(long, value_name = "NAME")]
    pub style: Option<String>,
    /// A motion (.npz) that the dance goes on from.
    #[arg(long, value_name = "MOTION.npz")]
    pub start: Option<PathBuf>,
    /// How many seconds of music after a frame help to find the beat in it; 0
    /// is what a live robot hears.
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS")]
    pub lookahead: f64,
    /// Weights to use in place of the built-in ones.
    #[arg(long, value_name = "FILE.safetensors")]
    pub model: Option<PathBuf>,
    /// What weights may need beside them, and a style in words.
    #[command(flatten)]
    pub conditioning: Conditioning,
    /// How codes are drawn.
    #[command(flatten)]
    pub sampling: SamplingArgs,
    /// Stop where a model that knows an end says so; else a new sequence
    /// goes on from there.
    #[arg(long)]
    pub until_end: bool,
    /// How the model's steps are computed.
    #[command(flatten)]
    pub engine: EngineArgs,
    #[arg(help = "Print only errors", long, short)]
    pub quiet: bool,
}

/// Writes the motion and prints what it is.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    MotionFormat::of(&args.out)?;
    let clip = generate(&GenerateRequest {
        audio: args.audio.map_or(AudioChoice::BuiltIn, AudioChoice::File),
        seconds: args.seconds,
        seed: args.seed,
        style: args.style,
        sampling: GeneratorOptions {
            at_end: match args.until_end {
                true => AtEnd::Stop,
                false => AtEnd::Chain,
            },
            ..args.sampling.options()
        },
        engine: args.engine.options(),
        start: args.start,
        lookahead_s: args.lookahead,
        model: args.model,
        conditioning: args.conditioning,
        quiet: args.quiet,
    })?;
    write_motion(&args.out, &clip)?;
    if !args.quiet {
        stdout_line!(
            "{}: {} frames, {:.2} s at {} FPS",
            args.out.display(),
            clip.poses.len(),
            clip.poses.len() as f64 / clip.fps,
            clip.fps
        );
    }
    Ok(ExitCode::SUCCESS)
}
