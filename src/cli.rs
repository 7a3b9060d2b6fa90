//! The command line: what can be asked for, with examples. Arguments become
//! one validated configuration here and are not looked at again.

use clap::{Args, Parser, Subcommand, ValueEnum};
use servodance_audio::source::PcmEncoding;
use std::path::PathBuf;

const DANCE_EXAMPLES: &str = "\
Examples:
  servodance dance
      the built-in song on the built-in humanoid, simulated, as fast as possible
  servodance dance song.ogg --robot op3 --report out.json --record out.mcap
      your song, with a report for scripts and a recording for robotics viewers
  servodance dance song.mp3 --bus serial:/dev/ttyUSB0
      a real robot, in real time (hold its power switch)
  arecord -f S16_LE -r 48000 -c 1 -t raw | servodance dance - --pcm-rate 48000 --speed realtime
      dance to whatever a capture program hears";

const SCAN_EXAMPLES: &str = "\
Examples:
  servodance scan
      the serial ports of this machine
  servodance scan /dev/ttyUSB0
      every servo that answers: baud rate, id, model, firmware, errors";

const SIM_BUS_EXAMPLES: &str = "\
Examples:
  servodance sim-bus --robot op3
      the first line is the serial port to open; Ctrl-C or SIGTERM ends it
  servodance dance --bus serial:/dev/pts/7
      dance on it from another terminal, as on real servos";

/// A robot hears music and dances to it.
#[derive(Debug, Parser)]
#[command(
    name = "servodance",
    version,
    propagate_version = true,
    max_term_width = 100
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What servodance can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Dance to a recording, to the built-in song, or to raw audio on standard input.
    #[command(after_help = DANCE_EXAMPLES)]
    Dance(DanceArgs),
    /// List the built-in robots and where each file is.
    Robots,
    /// Look for Dynamixel servos on a serial port, at every usual baud rate.
    #[command(after_help = SCAN_EXAMPLES)]
    Scan {
        /// The serial port; the ports of this machine are listed if left out.
        #[arg(value_name = "PORT")]
        port: Option<String>,
        /// Only this baud rate.
        #[arg(long, value_name = "BAUD")]
        baud: Option<u32>,
    },
    /// Serve a robot's simulated servos to any program, until stopped.
    #[command(after_help = SIM_BUS_EXAMPLES)]
    SimBus {
        /// A built-in robot (see `servodance robots`) or a robot file.
        #[arg(long, default_value = "op3", value_name = "NAME|FILE.toml")]
        robot: String,
    },
    /// Write the built-in song as a WAV file.
    Song {
        /// The file to write.
        #[arg(long, default_value = "servodance-song.wav", value_name = "FILE.wav")]
        out: PathBuf,
    },
}

/// How fast time passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Speed {
    /// As fast as the machine can; time is simulated and runs are repeatable.
    Max,
    /// By the clock on the wall.
    Realtime,
}

/// Arguments of `dance`.
#[derive(Debug, Args)]
pub struct DanceArgs {
    /// The recording (wav, flac, mp3, ogg), or `-` for raw PCM on standard
    /// input; the built-in song if left out.
    #[arg(value_name = "AUDIO")]
    pub audio: Option<PathBuf>,

    /// A built-in robot (see `servodance robots`) or a robot file.
    #[arg(long, default_value = "op3", value_name = "NAME|FILE.toml")]
    pub robot: String,

    /// Where commands go: `sim`, or `serial:/dev/ttyUSB0`.
    #[arg(long, default_value = "sim", value_name = "BUS")]
    pub bus: String,

    /// How fast time passes; `max` on the simulated bus, `realtime` on a real one.
    #[arg(long, value_enum)]
    pub speed: Option<Speed>,

    /// The same seed and the same input give the same dance.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,

    /// Dance style; an unknown one lists those that the model knows.
    #[arg(long, value_name = "NAME")]
    pub style: Option<String>,

    /// Weights to use in place of the built-in ones.
    #[arg(long, value_name = "FILE.safetensors")]
    pub model: Option<PathBuf>,

    /// Write figures of the run as JSON (see docs/report.md).
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,

    /// Record everything as MCAP, for robotics viewers.
    #[arg(long, value_name = "FILE.mcap")]
    pub record: Option<PathBuf>,

    /// Where the picture of the dance goes.
    #[arg(long, default_value = "dance.png", value_name = "FILE.png")]
    pub picture: PathBuf,

    /// Draw no picture.
    #[arg(long, conflicts_with = "picture")]
    pub no_picture: bool,

    /// Sample rate of raw PCM on standard input, hertz.
    #[arg(long, default_value_t = 48_000, value_name = "HZ")]
    pub pcm_rate: u32,

    /// Sample format of raw PCM on standard input.
    #[arg(
        long,
        default_value = "s16le",
        value_name = "u8|s16le|s24le|s32le|f32le"
    )]
    pub pcm_format: PcmEncoding,

    /// Channels of raw PCM on standard input, interleaved.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub pcm_channels: u16,

    /// Print only errors.
    #[arg(long, short)]
    pub quiet: bool,
}
