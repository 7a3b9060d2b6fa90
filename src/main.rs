//! The command line program: the one place of exit codes.
//!
//! 0: done; 1: refused or failed, with one line on standard error; 2: wrong
//! usage; 130: stopped by Ctrl-C (torque is off, files are whole).

use clap::Parser;
use servodance::cli::{Cli, Command, DanceArgs};
use servodance::dance::{DanceConfig, dance};
use servodance::robot::{BUILT_IN, Robot};
use servodance::summary::summary;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const INTERRUPTED: u8 = 130;

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Dance(args) => run_dance(args),
        Command::Robots => list_robots(),
        Command::Scan { port, baud } => scan(port.as_deref(), baud),
        Command::SimBus { robot } => sim_bus(&robot),
        Command::Song { out } => write_song(&out),
    };
    result.unwrap_or_else(|error| {
        eprintln!("error: {}", one_line(&error));
        ExitCode::FAILURE
    })
}

/// The error and its causes, in one line.
fn one_line(error: &anyhow::Error) -> String {
    format!("{error:#}").replace('\n', " ")
}

fn run_dance(args: DanceArgs) -> anyhow::Result<ExitCode> {
    let config = DanceConfig::from_args(args)?;
    let stop = stop_signal()?;
    let outcome = dance(&config, &stop)?;
    if !config.quiet {
        print!("{}", summary(&config, &outcome.report));
    }
    if outcome.interrupted {
        eprintln!("stopped; torque is off");
        return Ok(ExitCode::from(INTERRUPTED));
    }
    Ok(ExitCode::SUCCESS)
}

/// Set by Ctrl-C and by SIGTERM.
fn stop_signal() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let handler_stop = Arc::clone(&stop);
    ctrlc::set_handler(move || handler_stop.store(true, Ordering::Release))?;
    Ok(stop)
}

fn scan(port: Option<&str>, baud: Option<u32>) -> anyhow::Result<ExitCode> {
    let lines = match port {
        Some(port) => servodance::bus_tools::scan(port, baud)?,
        None => servodance::bus_tools::ports(),
    };
    for line in lines {
        println!("{line}");
    }
    Ok(ExitCode::SUCCESS)
}

fn sim_bus(robot: &str) -> anyhow::Result<ExitCode> {
    let robot = Robot::load(robot)?;
    let stop = stop_signal()?;
    let served = servodance::bus_tools::serve(&robot, &stop, |port| println!("{port}"))?;
    eprintln!("{served}");
    Ok(ExitCode::SUCCESS)
}

fn list_robots() -> anyhow::Result<ExitCode> {
    for built_in in BUILT_IN {
        let robot = Robot::load(built_in.name)?;
        println!(
            "{:<10}{} ({} servos, {:.0} Hz)\n{:<10}{}",
            robot.name,
            robot.description,
            robot.servos.len(),
            robot.control_hz,
            "",
            built_in.file
        );
    }
    println!("\nYour own: copy one of these files, then --robot my-robot.toml");
    Ok(ExitCode::SUCCESS)
}

fn write_song(path: &Path) -> anyhow::Result<ExitCode> {
    servodance::song::write_demo(path)?;
    println!("{}", path.display());
    Ok(ExitCode::SUCCESS)
}
