//! `servodance robots`.

use crate::cli::prelude::*;
use servodance_runtime::robot::{BUILT_IN, place_of};

const EXAMPLES: &str = include_str!("examples/robots.txt").trim_ascii_end();

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {}

/// Prints the built-in robots.
pub fn run(_: Args) -> anyhow::Result<ExitCode> {
    for built_in in BUILT_IN {
        let robot = Robot::load(built_in.name)?;
        stdout_line!(
            "{:<12}{} ({} servos, {:.0} Hz)\n{:<12}{}",
            robot.name,
            robot.description,
            robot.servos.len(),
            robot.control_hz,
            "",
            place_of(built_in).display()
        );
    }
    stdout_line!(
        "\nYour own: copy one of these files and the URDF beside it, then --robot my-robot.toml"
    );
    Ok(ExitCode::SUCCESS)
}
