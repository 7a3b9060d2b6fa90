//! What a dance is to be, checked once: nothing here is text any more.

use crate::control::bus_choice::BusChoice;
use crate::control::idle::IdleStyle;
use crate::pipeline::conditioning::Conditioning;
use crate::robot::Robot;
use clap::ValueEnum;
use servodance_audio::source::PcmFormat;
use servodance_model::engine::EngineOptions;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Where the music comes from.
#[derive(Clone, Debug)]
pub enum AudioChoice {
    /// The song rendered by this program.
    BuiltIn,
    /// A recording.
    File(PathBuf),
    /// Raw PCM on standard input.
    Stdin(PcmFormat),
    /// An input of the system by id or name; the default one if `None`.
    Microphone(Option<String>),
}

impl AudioChoice {
    /// Whether sound comes in as it happens, without a look ahead.
    pub fn is_live(&self, speed: Speed) -> bool {
        match self {
            AudioChoice::BuiltIn | AudioChoice::File(_) => false,
            AudioChoice::Stdin(_) => speed == Speed::Realtime,
            AudioChoice::Microphone(_) => true,
        }
    }
}

/// How fast time passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Speed {
    /// As fast as the machine can; time is simulated and runs are repeatable.
    Max,
    /// By the clock on the wall.
    Realtime,
}

/// A whole dance.
#[derive(Clone, Debug)]
pub struct DanceConfig {
    /// Where the music comes from.
    pub audio: AudioChoice,
    /// Who dances.
    pub robot: Robot,
    /// Where commands go, for each bus of the robot.
    pub buses: Vec<BusChoice>,
    /// How fast time passes.
    pub speed: Speed,
    /// Whether a recording is danced to as if it came in live.
    pub as_live: bool,
    /// Whether the motion is steered onto the beat at the servos.
    pub compensation: bool,
    /// What to do while there is no music.
    pub idle: IdleStyle,
    /// Seed of the generator.
    pub seed: u64,
    /// Style, if asked for.
    pub style: Option<String>,
    /// Weights, if not the built-in ones.
    pub model: Option<PathBuf>,
    /// What those weights may need beside them, and a style in words.
    pub conditioning: Conditioning,
    /// How the model's steps are computed.
    pub engine: EngineOptions,
    /// Where the report goes.
    pub report: Option<PathBuf>,
    /// Where the recording goes.
    pub record: Option<PathBuf>,
    /// Where the picture goes.
    pub picture: Option<PathBuf>,
    /// Where the moving picture goes.
    pub gif: Option<PathBuf>,
    /// Where viewers are served, if they are.
    pub view: Option<SocketAddr>,
    /// Whether the terminal shows the dance and takes keys.
    pub tui: bool,
    /// Whether each dance waits for somebody to say `start`.
    pub wait_for_start: bool,
    /// A file that is the emergency stop.
    pub estop_file: Option<PathBuf>,
    /// Print only errors.
    pub quiet: bool,
}
