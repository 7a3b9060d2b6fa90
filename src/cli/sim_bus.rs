//! `servodance sim-bus`.

use crate::cli::prelude::*;
use anyhow::Context;
use servodance_runtime::bus_tools::serve;
use servodance_runtime::bus_tools::sim_link::LinkChoice;
use servodance_runtime::world::WorldChoice;

const EXAMPLES: &str = include_str!("examples/sim-bus.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    pub robot: RobotFileArgs,
    /// What other programs open: a serial port (pty), a serial CAN adapter (slcan), a
    /// socket in place of either (unix) or multicast (udp); pty or slcan if left out,
    /// as the robot's bus needs.
    #[arg(long, value_enum)]
    pub link: Option<LinkChoice>,
    /// Give the gears the play that their vendor states (15 arc minutes for XM430, XM540
    /// and XH540; none for the others).
    #[arg(long)]
    pub backlash: bool,
    /// What is around the robot: a floor or a stand, for which the servos carry its
    /// weight (a hand holds it until all have torque), or none. On a floor it stays down
    /// after torque off until a fault lifts it.
    #[arg(long, value_enum, default_value = "none")]
    pub world: WorldChoice,
    /// Servos as they come out of the box (Dynamixel X: 57,600 baud; each with id 1), none
    /// plugged in: type `plug JOINT`, `unplug JOINT`, or `new JOINT` to have a joint's servo
    /// as out of the box again.
    #[arg(long, conflicts_with = "world")]
    pub new_servos: bool,
    /// Something that goes wrong: TIME JOINT|wire|adapter WHAT VALUE (some have none), such as
    /// "3s l_knee dead" or "5s wire corrupt 0.01", or in a world "8s push 1 0 1.5" (towards
    /// x y, newton seconds) or "9s lift"; "2s plug l_knee", "2s unplug l_knee"; may be given
    /// again.
    #[arg(long, value_name = "FAULT")]
    pub fault: Vec<String>,
    /// A file with a fault on each line.
    #[arg(long, value_name = "FILE")]
    pub faults: Option<PathBuf>,
}

pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let robot = args.robot.load()?;
    let mut faults = args.fault.join("\n");
    if let Some(file) = &args.faults {
        let text = std::fs::read_to_string(file)
            .with_context(|| format!("cannot read faults {}", file.display()))?;
        faults = format!("{faults}\n{text}");
    }
    let stop = stop_signal()?;
    let options = serve::SimBusOptions {
        link: args.link,
        faults: &faults,
        backlash: args.backlash,
        world: args.world,
        new_servos: args.new_servos,
    };
    let served = serve::serve(&robot, options, &stop, |port| stdout_line!("{port}"))?;
    stderr_line!("{served}");
    Ok(ExitCode::SUCCESS)
}
