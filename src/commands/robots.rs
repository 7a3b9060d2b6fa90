//! `servodance robots`.

use crate::console::say;
use crate::robot::{BUILT_IN, Robot};
use std::process::ExitCode;

/// `robots` asks for nothing.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// Prints the built-in robots.
pub fn run(_: Args) -> anyhow::Result<ExitCode> {
    for built_in in BUILT_IN {
        let robot = Robot::load(built_in.name)?;
        say!(
            "{:<10}{} ({} servos, {:.0} Hz)\n{:<10}{}",
            robot.name,
            robot.description,
            robot.servos.len(),
            robot.control_hz,
            "",
            built_in.file
        );
    }
    say!("\nYour own: copy one of these files, then --robot my-robot.toml");
    Ok(ExitCode::SUCCESS)
}
