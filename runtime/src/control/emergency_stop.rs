//! The emergency stop of a dance: a key, a signal, a file.
//!
//! - Enter, where standard input is a terminal.
//! - `SIGUSR1` (`pkill -USR1 servodance`).
//! - A file that exists and does not begin with `0`: an empty file as a button
//!   for scripts, or the value of a GPIO line. A file that is there and cannot
//!   be read counts as pressed.
//!
//! The button stays down ([`EStop`]): a file that goes away again does not
//! release it. A watch that panics presses the button, because nothing would
//! notice the next press.

use crate::process::failpoint;
use servodance_drivers::EStop;
use signal_hook::consts::SIGUSR1;
use std::io::{ErrorKind, IsTerminal};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// How often the file and the signal are looked at.
const EVERY: Duration = Duration::from_millis(10);

/// Watches the three ways until it is dropped.
pub struct EmergencyStopWatch {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl EmergencyStopWatch {
    /// Watches the signal, and the file if there is one. `keyboard`: standard
    /// input is free for the key.
    pub fn start(estop: &EStop, file: Option<PathBuf>, keyboard: bool) -> anyhow::Result<Self> {
        let signal = Arc::new(AtomicBool::new(false));
        signal_hook::flag::register(SIGUSR1, Arc::clone(&signal))?;
        if keyboard && std::io::stdin().is_terminal() {
            watch_key(estop.clone())?;
        }
        if let Some(file) = file.as_deref().filter(|file| is_pressed(file)) {
            estop.press(&cause_of(file)); // before anything moves
        }
        let stop = Arc::new(AtomicBool::new(false));
        let (ended, estop) = (Arc::clone(&stop), estop.clone());
        let thread = std::thread::Builder::new().name("emergency stop".into());
        let thread = thread.spawn(move || {
            let _alarm = PressedByPanic(estop.clone());
            while !ended.load(Ordering::Acquire) {
                failpoint::pass("emergency stop");
                if signal.swap(false, Ordering::AcqRel) {
                    estop.press("the signal SIGUSR1");
                }
                if let Some(file) = file.as_deref().filter(|file| is_pressed(file)) {
                    estop.press(&cause_of(file));
                }
                std::thread::sleep(EVERY);
            }
        })?;
        Ok(Self { stop, thread: Some(thread) })
    }
}

/// Presses the button if the thread that holds it panics.
struct PressedByPanic(EStop);

impl Drop for PressedByPanic {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.press("its watch broke down");
        }
    }
}

impl Drop for EmergencyStopWatch {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // A panic there has already been printed.
            let _ = thread.join();
        }
    }
}

/// A thread that lives as long as the program: reading a key cannot be ended.
/// A button that was released can be pressed again.
fn watch_key(estop: EStop) -> anyhow::Result<()> {
    let thread = std::thread::Builder::new().name("emergency stop key".into());
    thread.spawn(move || {
        let _alarm = PressedByPanic(estop.clone());
        let mut line = String::new();
        while matches!(std::io::stdin().read_line(&mut line), Ok(1..)) {
            estop.press("the key");
            line.clear();
        }
    })?;
    Ok(())
}

fn cause_of(file: &Path) -> String {
    format!("the file {}", file.display())
}

/// Whether the file stands for a pressed button.
fn is_pressed(file: &Path) -> bool {
    match std::fs::read(file) {
        Ok(bytes) => bytes.trim_ascii_start().first() != Some(&b'0'),
        Err(error) => error.kind() != ErrorKind::NotFound,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_a_button() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("stop");
        assert!(!is_pressed(&file));
        for (content, pressed) in [("", true), ("1\n", true), ("0\n", false), ("stop", true)] {
            std::fs::write(&file, content).unwrap();
            assert_eq!(is_pressed(&file), pressed, "{content:?}");
        }
        assert!(is_pressed(folder.path()), "what cannot be read is pressed");
    }

    #[test]
    fn the_button_stays_down_when_the_file_goes_away() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("stop");
        let estop = EStop::default();
        let _watch = EmergencyStopWatch::start(&estop, Some(file.clone()), false).unwrap();
        assert!(!estop.is_pressed());
        std::fs::write(&file, "").unwrap();
        while !estop.is_pressed() {
            std::thread::sleep(EVERY);
        }
        std::fs::remove_file(&file).unwrap();
        std::thread::sleep(5 * EVERY);
        assert!(estop.is_pressed() && estop.cause().starts_with("the file "));
    }
}
