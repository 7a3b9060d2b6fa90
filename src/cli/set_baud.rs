//! `servodance set-baud`.

use crate::cli::prelude::*;
use servodance_runtime::bus_tools::set_baud::{BaudChange, Whose};

const EXAMPLES: &str = include_str!("examples/set-baud.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[arg(help = "The serial port", value_name = "PORT")]
    pub port: String,
    /// The id of the servo, or `all` for every servo that answers.
    #[arg(value_name = "ID|all", value_parser = whose)]
    pub whose: Whose,
    /// The rate that it is to have, bits a second.
    #[arg(value_name = "BAUD")]
    pub to: u32,
    /// The rate that it has; every usual one is tried if left out.
    #[arg(long, value_name = "BAUD")]
    pub from: Option<u32>,
    #[arg(help = "Only this protocol", long, value_enum, default_value_t)]
    pub protocol: ProtocolChoice,
    #[arg(help = "Do not ask", long)]
    pub yes: bool,
}

fn whose(text: &str) -> Result<Whose, String> {
    match text.parse() {
        _ if text == "all" => Ok(Whose::All),
        Ok(id) if id <= 253 => Ok(Whose::One(id)),
        _ => Err(format!("\"{text}\" is no id: 0 to 253, or all")),
    }
}

/// Changes the rate, and looks for each servo there.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let change = BaudChange {
        port: &args.port,
        whose: args.whose,
        to: args.to,
        from: args.from,
        protocol: args.protocol,
    };
    change.run(Consent::from_flag(args.yes), |line| stdout_line!("{line}"))?;
    Ok(ExitCode::SUCCESS)
}
