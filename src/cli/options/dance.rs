//! Options of the commands that dance with a robot.

use super::robot::RobotFileArgs;
use servodance_runtime::control::idle::IdleStyle;
use std::path::PathBuf;

/// A robot that dances.
#[derive(Debug, clap::Args)]
pub struct RobotArgs {
    #[command(flatten)]
    pub robot: RobotFileArgs,
    /// Where commands go: `sim`, `serial:/dev/ttyUSB0`, `can:can0`, `slcan:/dev/ttyACM0` or
    /// `ros2:HOST:9090`; for a robot with several buses once for each,
    /// `left=serial:/dev/ttyUSB0`.
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
