//! What the program says, on standard output and standard error.
//!
//! Whoever reads it may go away (`servodance robots | head -1`). That is no
//! reason to panic, least of all while motors move: what nobody hears is lost.
//! `println!` and its kin are not used elsewhere (a lint sees to it).

use std::fmt::Arguments;
use std::io::Write;
use std::panic::PanicHookInfo;

/// A line on standard output.
macro_rules! say {
    ($($text:tt)*) => {
        $crate::console::stdout(format_args!("{}\n", format_args!($($text)*)))
    };
}

/// A line on standard error.
macro_rules! tell {
    ($($text:tt)*) => {
        $crate::console::stderr(format_args!("{}\n", format_args!($($text)*)))
    };
}

pub(crate) use {say, tell};

/// Text on standard output, at once.
pub fn stdout(text: Arguments) {
    let mut out = std::io::stdout().lock();
    let _ = out.write_fmt(text).and_then(|()| out.flush());
}

/// Text on standard error.
pub fn stderr(text: Arguments) {
    let _ = std::io::stderr().lock().write_fmt(text);
}

/// From now on a thread that panics says so in one line on standard error.
pub fn tell_panics_in_a_line() {
    std::panic::set_hook(Box::new(|panic| tell!("{}", panic_line(panic))));
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
