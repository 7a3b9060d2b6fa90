//! Lines on standard output and standard error.
//!
//! The reader of a pipe may go away (`servodance robots | head -1`). That is no
//! reason to panic, least of all while motors move: such output is dropped.
//! `println!` and its kin are not used elsewhere (a lint sees to it).
//!
//! While the terminal view draws ([`HeldLines`]), lines for the terminal wait,
//! panics too; lines of a redirected stream are passed on at once.

use std::collections::VecDeque;
use std::fmt::Arguments;
use std::io::{ErrorKind, IsTerminal, Write};
use std::panic::PanicHookInfo;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Lines that wait at most; the oldest go.
const WAITING: usize = 1000;

/// Prints a line on standard output, which may be closed.
#[macro_export]
macro_rules! stdout_line {
    ($($text:tt)*) => {
        $crate::process::console::stdout(format_args!("{}\n", format_args!($($text)*)))
    };
}

/// Prints a line on standard error, which may be closed.
#[macro_export]
macro_rules! stderr_line {
    ($($text:tt)*) => {
        $crate::process::console::stderr(format_args!("{}\n", format_args!($($text)*)))
    };
}

pub use {stderr_line, stdout_line};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stream {
    Output,
    Error,
}

impl Stream {
    fn write(self, text: &str) {
        match self {
            Self::Output => {
                let mut out = std::io::stdout().lock();
                let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
                if written.is_err_and(|error| error.kind() != ErrorKind::BrokenPipe) {
                    OUTPUT_IS_CUT.store(true, Ordering::Relaxed);
                }
            }
            Self::Error => drop(std::io::stderr().lock().write_all(text.as_bytes())),
        }
    }

    fn is_terminal(self) -> bool {
        match self {
            Self::Output => std::io::stdout().is_terminal(),
            Self::Error => std::io::stderr().is_terminal(),
        }
    }
}

/// Text for standard output was lost, and not because its reader went away.
static OUTPUT_IS_CUT: AtomicBool = AtomicBool::new(false);

/// Whether standard output lacks text that could not be written: on a full disk, say.
pub fn output_is_cut() -> bool {
    OUTPUT_IS_CUT.load(Ordering::Relaxed)
}

/// Lines that wait; `None` while the terminal is free.
static HELD: Mutex<Option<VecDeque<(Stream, String)>>> = Mutex::new(None);

fn held() -> MutexGuard<'static, Option<VecDeque<(Stream, String)>>> {
    HELD.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Text on standard output, at once unless it must wait.
pub fn stdout(text: Arguments) {
    write_or_hold(Stream::Output, text);
}

/// Text on standard error, at once unless it must wait.
pub fn stderr(text: Arguments) {
    write_or_hold(Stream::Error, text);
}

fn write_or_hold(stream: Stream, text: Arguments) {
    let text = text.to_string();
    let is_held = held().as_mut().is_some_and(|lines| {
        if lines.len() == WAITING {
            lines.pop_front();
        }
        lines.push_back((stream, text.clone()));
        stream.is_terminal()
    });
    if !is_held {
        stream.write(&text);
    }
}

/// Whether lines wait at present.
pub fn is_holding() -> bool {
    held().is_some()
}

/// The newest of the lines that wait, oldest first.
pub fn newest(count: usize) -> Vec<String> {
    let lines_held = held();
    let lines = lines_held.iter().flatten().flat_map(|(_, text)| text.lines());
    let lines: Vec<&str> = lines.filter(|line| !line.trim().is_empty()).collect();
    let from = lines.len().saturating_sub(count);
    lines[from..].iter().map(ToString::to_string).collect()
}

/// Until it is dropped, lines for the terminal wait; then they are printed.
#[derive(Debug)]
#[must_use]
pub struct HeldLines(());

impl HeldLines {
    /// Lines wait from now on.
    pub fn begin() -> Self {
        *held() = Some(VecDeque::new());
        Self(())
    }
}

impl Drop for HeldLines {
    fn drop(&mut self) {
        let lines = held().take();
        for (stream, text) in lines.into_iter().flatten() {
            if stream.is_terminal() {
                stream.write(&text);
            }
        }
    }
}

/// From now on a thread that panics says so in one line on standard error, and
/// so does a bus that is dropped and cannot turn torque off.
pub fn report_panics_in_one_line() {
    std::panic::set_hook(Box::new(|panic| stderr_line!("{}", panic_line(panic))));
    servodance_drivers::set_torque_alarm(|text| stderr_line!("{text}"));
}

fn panic_line(panic: &PanicHookInfo) -> String {
    let thread = std::thread::current();
    let payload = panic.payload();
    let owned = payload.downcast_ref::<String>().map(String::as_str);
    let text = payload.downcast_ref::<&str>().copied().or(owned);
    let place = panic.location().map(ToString::to_string);
    format!(
        "a mistake in this program: the thread \"{}\" broke down at {}: {}",
        thread.name().unwrap_or("?"),
        place.unwrap_or_default(),
        text.unwrap_or("no reason given").replace('\n', " ")
    )
}
