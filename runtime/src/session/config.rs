//! The configuration of a dance, checked once: nothing here is text any more.

use crate::control::bus_choice::BusChoice;
use crate::control::idle::IdleStyle;
use crate::control::motion_log::MotionLog;
use crate::control::timing::{LoopOptions, MotionArrival};
use crate::pipeline::audio_input::AudioChoice;
use crate::pipeline::model_args::GeneratorArgs;
use crate::pipeline::speaker::SpeakerConfig;
use crate::process::speed::Speed;
use crate::robot::Robot;
use crate::world::WorldChoice;
use servodance_audio::TempoRange;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Everything that decides a dance.
#[derive(Clone, Debug)]
#[allow(missing_docs)] // the other names say it
pub struct DanceConfig {
    pub audio: AudioChoice,
    pub robot: Robot,
    /// Where commands go, for each bus of the robot.
    pub buses: Vec<BusChoice>,
    /// The world that simulated servos carry the robot in.
    pub world: WorldChoice,
    pub speed: Speed,
    /// Whether a recording is danced to as if it came in live.
    pub as_live: bool,
    /// Whether the motion is steered onto the beat at the servos.
    pub compensation: bool,
    /// What to do while there is no music.
    pub idle: IdleStyle,
    /// Tempi that are followed; any if left out.
    pub tempo: Option<TempoRange>,
    pub generator: GeneratorArgs,
    pub report: Option<PathBuf>,
    pub record: Option<PathBuf>,
    pub picture: Option<PathBuf>,
    pub gif: Option<PathBuf>,
    /// Address of the page for viewers, if there is one.
    pub view: Option<SocketAddr>,
    /// How long the robot dances on while no operator has its page open, seconds.
    pub dead_man_s: Option<f64>,
    pub tui: bool,
    /// Whether each dance waits for a viewer's `start`.
    pub wait_for_start: bool,
    pub estop_file: Option<PathBuf>,
    /// The loudspeaker that plays the song, if one shall.
    pub speaker: Option<SpeakerConfig>,
    /// Where each control cycle is noted, for measurements.
    pub motion_log: Option<MotionLog>,
    /// Whether only errors are printed.
    pub quiet: bool,
}

impl DanceConfig {
    pub(super) fn loop_options(&self) -> LoopOptions {
        LoopOptions {
            speed: self.speed,
            arrival: match (self.as_live, self.audio.is_live(self.speed)) {
                (true, _) => MotionArrival::AsLive,
                (false, true) => MotionArrival::Live,
                (false, false) => MotionArrival::Ahead,
            },
            compensation: self.compensation,
            idle: self.idle,
        }
    }
}
