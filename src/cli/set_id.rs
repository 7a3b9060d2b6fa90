//! `servodance set-id`.

use crate::cli::prelude::*;
use servodance_runtime::bus_tools::set_id;

const EXAMPLES: &str = include_str!("examples/set-id.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[arg(help = "The serial port", value_name = "PORT")]
    pub port: String,
    /// The id it has.
    #[arg(value_name = "OLD")]
    pub old: u16,
    /// The id it is to have.
    #[arg(value_name = "NEW")]
    pub new: u16,
    /// Only this baud rate.
    #[arg(long, value_name = "BAUD")]
    pub baud: Option<u32>,
    #[arg(help = "Only this protocol", long, value_enum, default_value_t)]
    pub protocol: ProtocolChoice,
    #[arg(help = "Do not ask", long)]
    pub yes: bool,
}

/// Changes the id and reads it back.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let consent = Consent::from_flag(args.yes);
    let ids = (args.old, args.new);
    let done = set_id::set_id(&args.port, ids, args.baud, args.protocol, consent)?;
    stdout_line!("{done}");
    Ok(ExitCode::SUCCESS)
}
