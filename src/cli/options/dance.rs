//! Options of the commands that dance: with a robot, with the model.

use super::engine::EngineArgs;
use super::robot::RobotFileArgs;
use servodance_runtime::control::idle::IdleStyle;
use servodance_runtime::pipeline::conditioning::Conditioning;
use std::path::PathBuf;

/// A robot that dances.
#[derive(Debug, clap::Args)]
pub struct RobotArgs {
    #[command(flatten)]
    pub robot: RobotFileArgs,

    /// Where commands go: `sim`, or `serial:/dev/ttyUSB0`; for a robot with
    /// several buses once for each, `left=serial:/dev/ttyUSB0`.
    #[arg(long, env = "SERVODANCE_BUS", default_value = "sim", value_name = "[NAME=]BUS")]
    pub bus: Vec<String>,

    /// What to do while there is no music, or nobody leads; `sway` if the robot
    /// file does not say.
    #[arg(long, value_enum)]
    pub idle: Option<IdleStyle>,

    /// Emergency stop: torque goes off when this file exists and does not begin
    /// with 0. So do Enter on the terminal and the signal SIGUSR1.
    #[arg(long, value_name = "PATH")]
    pub estop_file: Option<PathBuf>,
}

/// A dance that the model invents as the music comes.
#[derive(Debug, clap::Args)]
pub struct GeneratorArgs {
    /// The same seed and the same input give the same dance.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,

    /// Dance style; an unknown one lists those that the model knows.
    #[arg(long, value_name = "NAME")]
    pub style: Option<String>,

    /// Weights to use in place of the built-in ones.
    #[arg(long, env = "SERVODANCE_MODEL", value_name = "FILE.safetensors")]
    pub model: Option<PathBuf>,

    /// What weights may need beside them, and a style in words.
    #[command(flatten)]
    pub conditioning: Conditioning,

    /// How the model's steps are computed.
    #[command(flatten)]
    pub engine: EngineArgs,
}
