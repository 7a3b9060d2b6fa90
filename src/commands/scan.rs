//! `servodance scan`.

use crate::bus_tools;
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  servodance scan
      the serial ports of this machine
  servodance scan /dev/ttyUSB0
      every servo that answers: baud rate, id, model, firmware, errors";

/// What `scan` is asked for.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The serial port; the ports of this machine are listed if left out.
    #[arg(value_name = "PORT")]
    pub port: Option<String>,
    /// Only this baud rate.
    #[arg(long, value_name = "BAUD")]
    pub baud: Option<u32>,
}

/// Prints a line for each servo, or for each port.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let lines = match args.port {
        Some(port) => bus_tools::scan(&port, args.baud)?,
        None => bus_tools::ports(),
    };
    for line in lines {
        println!("{line}");
    }
    Ok(ExitCode::SUCCESS)
}
