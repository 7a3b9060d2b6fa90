//! The command line program: the one place of exit codes.
//!
//! 0: done; 1: refused or failed, with one line on standard error; 2: wrong
//! usage; 130: stopped by Ctrl-C (torque is off, files are whole).

use clap::Parser;
use servodance::cli::Cli;
use servodance_runtime::process::wrong_usage::WrongUsage;
use std::process::ExitCode;

/// Exit code after wrong usage, as of `clap`.
const WRONG_USAGE: u8 = 2;

fn main() -> ExitCode {
    servodance_runtime::process::console::report_panics_in_one_line();
    Cli::parse().run().unwrap_or_else(|error| {
        let text = one_line(&error);
        servodance_runtime::process::console::stderr(format_args!("error: {text}\n"));
        match WrongUsage::is_in(&error) {
            true => ExitCode::from(WRONG_USAGE),
            false => ExitCode::FAILURE,
        }
    })
}

/// The error and its causes, in one line.
fn one_line(error: &anyhow::Error) -> String {
    format!("{error:#}").replace('\n', " ")
}
