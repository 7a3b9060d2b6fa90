//! `servodance scan`.

use crate::cli::prelude::*;
use servodance_runtime::bus_tools::scan;

const EXAMPLES: &str = include_str!("examples/scan.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The serial port, or a CAN bus: can:IFACE, slcan:PATH, udp:GROUP:PORT. The serial
    /// ports of this machine are listed if left out.
    #[arg(value_name = "PORT")]
    pub port: Option<String>,
    /// Only this baud rate, or bitrate of an slcan adapter.
    #[arg(long, value_name = "BAUD")]
    pub baud: Option<u32>,
    /// Only this protocol of serial servos.
    #[arg(long, value_enum, default_value_t)]
    pub protocol: ProtocolChoice,
}

/// Prints a line for each servo, or for each port.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let say = |line: &str| stdout_line!("{line}");
    match args.port {
        Some(port) => scan::scan(&port, args.baud, args.protocol, say, |n| stderr_line!("{n}"))?,
        None => scan::ports().iter().for_each(|line| say(line)),
    }
    Ok(ExitCode::SUCCESS)
}
