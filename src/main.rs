//! The command line program: the one place of exit codes.
//!
//! 0: done; 1: refused or failed, with one line on standard error; 2: wrong
//! usage; 130: stopped by Ctrl-C (torque is off, files are whole).

use clap::Parser;
use clap::error::ErrorKind;
use servodance::cli::guesses::hint;
use servodance::cli::{Cli, INTERRUPTED};
use servodance_runtime::process::console::{self, stderr_line};
use servodance_runtime::process::interrupted::Interrupted;
use servodance_runtime::process::wrong_usage::WrongUsage;
use signal_hook::consts::SIGXFSZ;
use std::process::ExitCode;
use std::sync::Arc;

/// Exit code after wrong usage, as of `clap`.
const WRONG_USAGE: u8 = 2;

fn main() -> ExitCode {
    console::report_panics_in_one_line();
    outlive_file_limits();
    let ended = match Cli::try_parse() {
        Ok(cli) => cli.run().unwrap_or_else(|error| told(&error)),
        Err(error) => misused(&error),
    };
    if console::output_is_cut() {
        stderr_line!("error: standard output could not be written: what stands there is cut");
        return ExitCode::FAILURE;
    }
    ended
}

/// A file that grows beyond `ulimit -f` is an error like a full disk, and no reason to be killed
/// while motors have torque.
fn outlive_file_limits() {
    // Any handler does: writing then fails. Without one the limit is as it was.
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::default());
}

/// Prints what is wrong with the command line; a usual guess and a value that is refused in one
/// line, like any other bad input.
fn misused(error: &clap::Error) -> ExitCode {
    match hint(error) {
        Some(hint) => stderr_line!("{hint}"),
        None if error.kind() != ErrorKind::ValueValidation => error.exit(),
        None => stderr_line!("{}", error.to_string().lines().next().unwrap_or_default()),
    }
    ExitCode::from(WRONG_USAGE)
}

/// Prints an error; its exit code.
fn told(error: &anyhow::Error) -> ExitCode {
    if error.is::<Interrupted>() {
        stderr_line!("{error}");
        return ExitCode::from(INTERRUPTED);
    }
    stderr_line!("error: {}", one_line(error));
    match WrongUsage::is_in(error) {
        true => ExitCode::from(WRONG_USAGE),
        false => ExitCode::FAILURE,
    }
}

/// The error and its causes, in one line.
fn one_line(error: &anyhow::Error) -> String {
    format!("{error:#}").replace('\n', " ")
}
