//! `servodance ping`.

use crate::cli::prelude::*;
use servodance_runtime::bus_tools::ping;

const EXAMPLES: &str = include_str!("examples/ping.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The serial port; with --robot the ports of its buses, as `dance --bus` takes
    /// them, with commas between several.
    #[arg(value_name = "PORT")]
    pub port: String,
    /// An id; with --robot, a joint (all of them if left out).
    #[arg(value_name = "ID|JOINT")]
    pub who: Option<String>,
    /// A built-in robot (see `servodance robots`) or a robot file.
    #[arg(long, value_name = "NAME|FILE.toml", conflicts_with_all = ["baud", "protocol"])]
    pub robot: Option<String>,
    /// Only this baud rate.
    #[arg(long, value_name = "BAUD")]
    pub baud: Option<u32>,
    #[arg(help = "Only this protocol", long, value_enum, default_value_t)]
    pub protocol: ProtocolChoice,
}

/// Prints a line for each servo; it is an error if one does not answer.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let lines = match (&args.robot, &args.who) {
        (Some(robot), who) => {
            let ports: Vec<String> = args.port.split(',').map(str::to_owned).collect();
            ping::joints(&Robot::load(robot)?, &ports, who.as_deref())?
        }
        (None, Some(who)) => match who.parse() {
            Ok(id) if id <= 253 => vec![ping::servo(&args.port, id, args.baud, args.protocol)?],
            _ => {
                let text =
                    format!("\"{who}\" is no id (0 to 253); the name of a joint needs --robot");
                return Err(WrongUsage(text).into());
            }
        },
        (None, None) => {
            let text = "which servo? give an id, or --robot for all joints of a robot";
            return Err(WrongUsage(text.into()).into());
        }
    };
    for line in lines {
        stdout_line!("{line}");
    }
    Ok(ExitCode::SUCCESS)
}
