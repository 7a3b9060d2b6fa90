//! What a dance is to be, checked once: nothing here is text any more.

use super::idle::IdleStyle;
use super::ports::{self, BusChoice};
use crate::commands::dance::Args;
use crate::conditioning::Conditioning;
use crate::robot::Robot;
use anyhow::bail;
use clap::ValueEnum;
use servodance_audio::source::PcmFormat;
use servodance_model::net::EngineOptions;
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

impl DanceConfig {
    /// Checks the arguments and loads the robot.
    pub fn from_args(args: Args) -> anyhow::Result<Self> {
        let robot = args.rig.robot.load()?;
        let buses = ports::choose(&robot, &args.rig.bus)?;
        let all_simulated = buses.iter().all(|bus| *bus == BusChoice::Sim);
        let hears = args.mic.is_some();
        let speed = match (args.speed, all_simulated) {
            (Some(Speed::Max), _) if hears => {
                bail!("--speed max needs a recording: a microphone lives in real time")
            }
            (Some(Speed::Max), false) => {
                bail!("--speed max needs the simulated bus: real servos live in real time")
            }
            (Some(Speed::Max), _) if args.view || args.tui => {
                bail!("--speed max cannot be watched: --view and --tui live in real time")
            }
            (Some(speed), _) => speed,
            (None, true) if !hears && !args.view && !args.tui => Speed::Max,
            (None, _) => Speed::Realtime,
        };
        Ok(Self {
            audio: audio_choice(&args)?,
            idle: args.rig.idle.unwrap_or(robot.idle),
            robot,
            buses,
            speed,
            as_live: args.as_live,
            compensation: !args.no_compensation,
            seed: args.invention.seed,
            style: args.invention.style,
            model: args.invention.model,
            conditioning: args.invention.conditioning,
            engine: args.invention.engine.options(),
            report: args.report,
            record: args.record,
            picture: (!args.no_picture).then_some(args.picture),
            gif: args.gif,
            view: args.view.then_some(args.view_bind),
            tui: args.tui,
            wait_for_start: args.wait_for_start,
            estop_file: args.rig.estop_file,
            quiet: args.quiet,
        })
    }
}

fn audio_choice(args: &Args) -> anyhow::Result<AudioChoice> {
    if let Some(device) = &args.mic {
        return Ok(AudioChoice::Microphone(device.clone()));
    }
    match &args.audio {
        None => Ok(AudioChoice::BuiltIn),
        Some(path) if path.as_os_str() == "-" => {
            if !(8_000..=384_000).contains(&args.pcm_rate) {
                bail!("--pcm-rate {} is outside 8000..384000", args.pcm_rate);
            }
            if !(1..=16).contains(&args.pcm_channels) {
                bail!("--pcm-channels {} is outside 1..16", args.pcm_channels);
            }
            Ok(AudioChoice::Stdin(PcmFormat {
                encoding: args.pcm_format,
                sample_rate_hz: args.pcm_rate,
                channels: args.pcm_channels,
            }))
        }
        Some(path) => Ok(AudioChoice::File(path.clone())),
    }
}
