//! Which robot a command is for: the same options for all that drive one.

use anyhow::Context;
use servodance_runtime::robot::Overrides;
use servodance_runtime::robot::Robot;

/// Who, and what of the robot file is different today.
#[derive(Debug, clap::Args)]
pub struct RobotFileArgs {
    /// A built-in robot (see `servodance robots`) or a robot file.
    #[arg(long, env = "SERVODANCE_ROBOT", default_value = "op3", value_name = "NAME|FILE.toml")]
    pub robot: String,
    /// Set a key of the robot file for this run, such as `safety.rearm=true`
    /// or `joint.l_knee.upper_deg=90`; may be given again. The environment
    /// does it too: `SERVODANCE_SAFETY__REARM=true`.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

impl RobotFileArgs {
    /// Loads it. What is wrong with the file, or with what is set.
    pub fn load(&self) -> anyhow::Result<Robot> {
        let overrides = Overrides::from_user(&self.set)?;
        Robot::load_with(&self.robot, &overrides).context("--robot")
    }
}
