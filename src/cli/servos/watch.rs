//! `servodance servos watch`.

use crate::cli::prelude::*;
use crate::cli::servos::PlacesArgs;
use servodance_runtime::bus_tools::memory::{Watch, watch};
use std::cell::Cell;
use std::io::IsTerminal;
use std::sync::atomic::Ordering;

/// Up so many lines, and clear what is below.
const UP_AND_CLEAR: &str = "A\x1b[J";

#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub places: PlacesArgs,
    /// One servo alone: its id, or a joint of the robot.
    #[arg(long, value_name = "ID|JOINT")]
    pub id: Option<String>,
    /// End after so many tables.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub count: Option<u64>,
}

/// Prints table after table; on a terminal each in the place of the one before.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let stop = stop_signal()?;
    let places = args.places.open()?;
    let in_place = std::io::stdout().is_terminal();
    let is_first = Cell::new(true);
    let show = |rows: &[String]| {
        let up = match in_place && !is_first.replace(false) {
            true => format!("\x1b[{}{UP_AND_CLEAR}", rows.len()),
            false => String::new(),
        };
        stdout(format_args!("{up}{}\n", rows.join("\n")));
    };
    let watched = Watch { places: &places, one: args.id.as_deref(), count: args.count };
    watch(&watched, &stop, show)?;
    Ok(match stop.load(Ordering::Acquire) {
        true => ExitCode::from(INTERRUPTED),
        false => ExitCode::SUCCESS,
    })
}
