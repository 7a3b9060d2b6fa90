//! `servodance follow`.

use super::options::dance::RobotArgs;
use super::options::file_ending::file_of;
use super::options::stage::RoleArgs;
use crate::cli::prelude::*;
use std::net::SocketAddr;

const EXAMPLES: &str = include_str!("examples/follow.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    pub rig: RobotArgs,
    #[command(flatten)]
    pub place: StageNetworkArgs,
    /// Name of the follower, for cues; the robot's if left out.
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    #[command(flatten)]
    pub role: RoleArgs,
    /// Stand at rest after so many seconds alone.
    #[arg(long, default_value_t = 60.0, value_name = "SECONDS", value_parser = within(0.0..=1e6))]
    pub rest_after: f64,
    /// Be seen by ROS 2 as a node with joint states, joint commands and the
    /// skeleton that is followed.
    #[arg(long)]
    pub ros2: bool,
    /// The domain of ROS 2.
    #[arg(long, env = "ROS_DOMAIN_ID", default_value_t = 0, value_name = "ID")]
    pub ros_domain: u32,
    /// Show the robot on a page in the browser.
    #[arg(long)]
    pub view: bool,
    /// The address that the page is served at.
    #[arg(long, default_value = "127.0.0.1:0", value_name = "IP:PORT", requires = "view")]
    pub view_bind: SocketAddr,
    /// Record everything as MCAP, for `servodance play` and robotics viewers.
    #[arg(long, value_name = "FILE.mcap", value_parser = file_of("mcap"))]
    pub record: Option<PathBuf>,
    /// Write figures of the run as JSON (see docs/stage.md).
    #[arg(long, value_name = "FILE.json", value_parser = file_of("json"))]
    pub report: Option<PathBuf>,
    #[arg(help = "Print only errors", long, short)]
    pub quiet: bool,
    /// For trials: a clock that is wrong by so many seconds.
    #[arg(long, default_value_t = 0.0, hide = true, allow_negative_numbers = true)]
    pub clock_offset: f64,
    /// For trials: a clock that is fast by so many millionths.
    #[arg(long, default_value_t = 0.0, hide = true, allow_negative_numbers = true)]
    pub clock_drift_ppm: f64,
    /// For trials: where the servos were when.
    #[arg(long, hide = true)]
    pub witness: Option<PathBuf>,
}

#[cfg(not(feature = "stage"))]
pub fn run(_: Args) -> anyhow::Result<ExitCode> {
    super::options::stage::not_built_in("follow")
}

#[cfg(feature = "stage")]
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    use servodance_runtime::control::bus_choice::choose as choose_buses;
    use servodance_runtime::process::console::stderr_line;
    use servodance_runtime::session::led_dance::FollowConfig;

    let robot = args.rig.robot.load()?;
    let name = args.name.unwrap_or_else(|| robot.name.clone());
    if !servodance_stage::messages::is_valid_name(&name) {
        anyhow::bail!("--name \"{name}\" cannot be a name: letters, digits, `_`, `-` and `.` can");
    }
    let options = servodance_runtime::stage::StageFollow {
        config: FollowConfig {
            buses: choose_buses(&robot, &args.rig.bus)?,
            idle: args.rig.idle.unwrap_or(robot.idle),
            robot,
            servo_truth: args.witness,
        },
        place: args.place.place(false, Vec::new()),
        stage: args.place.stage,
        name,
        role: args.role.role(),
        rest_after_s: args.rest_after,
        ros_domain: args.ros2.then_some(args.ros_domain),
        skew: (args.clock_offset, args.clock_drift_ppm * 1e-6),
        estop_file: args.rig.estop_file,
        report: args.report,
        quiet: args.quiet,
        view: args.view.then_some(args.view_bind),
        record: args.record,
    };
    let stop = super::motor_stop_signal()?;
    let is_reachable = !args.view_bind.ip().is_loopback();
    let on_page = |page: &_| super::options::links::say_links(page, is_reachable);
    let report = servodance_runtime::stage::follow(&options, &stop, on_page)?;
    let broken = report.followed.violations.unwrap_or_default();
    if broken != Default::default() {
        anyhow::bail!(
            "the simulated servos saw limits broken: {} position, {} velocity, {} acceleration",
            broken.position,
            broken.velocity,
            broken.acceleration
        );
    }
    stderr_line!("stopped; torque is off");
    Ok(ExitCode::from(super::INTERRUPTED))
}
