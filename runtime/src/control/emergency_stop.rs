//! The emergency stop of a dance: a key, a signal, a file.
//!
//! - Enter, where standard input is a terminal. Ctrl-D there is no press, and takes no press away.
//! - `SIGUSR1` (`pkill -USR1 servodance`).
//! - A file that exists and does not begin with `0`: an empty file as a button
//!   for scripts, or the value of a GPIO line. A file that is there and cannot
//!   be read counts as pressed; a pipe or a socket is refused, for who opens one waits.
//!
//! The button stays down ([`EStop`]): a file that goes away again does not
//! release it. A watch that panics presses the button, because nothing would
//! notice the next press.

use crate::process::failpoint;
use anyhow::bail;
use servodance_drivers::EStop;
use signal_hook::consts::SIGUSR1;
use std::fs::File;
use std::io::{ErrorKind, IsTerminal, Read};
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// How often the file and the signal are looked at.
const EVERY: Duration = Duration::from_millis(10);
/// How often a terminal is asked that belongs to another program now.
const LOOK_AGAIN: Duration = Duration::from_millis(100);
/// So many bytes of a file say whether it stands for a pressed button.
const TELLING: u64 = 64;

/// Watches the three ways until it is dropped.
pub struct EmergencyStopWatch {
    stop: Arc<AtomicBool>,
    signal: Option<JoinHandle<()>>,
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
        if let Some(file) = &file {
            refuse_pipes(file)?;
            press_if_it_says_so(estop, file); // before anything moves
        }
        let stop = Arc::new(AtomicBool::new(false));
        // A file may lie where reading hangs (a network mount): the signal does not wait for it.
        if let Some(file) = file {
            let pressed = estop.clone();
            let watch = move || press_if_it_says_so(&pressed, &file);
            watch_every("emergency stop file", estop, &stop, watch)?;
        }
        let pressed = estop.clone();
        let watch = move || {
            failpoint::pass("emergency stop");
            if signal.swap(false, Ordering::AcqRel) {
                pressed.press("the signal SIGUSR1");
            }
        };
        let signal = Some(watch_every("emergency stop", estop, &stop, watch)?);
        Ok(Self { stop, signal })
    }
}

/// Calls `watch` again and again, on a thread of its own, until `ended`.
fn watch_every(
    name: &str,
    estop: &EStop,
    ended: &Arc<AtomicBool>,
    watch: impl Fn() + Send + 'static,
) -> std::io::Result<JoinHandle<()>> {
    let (ended, estop) = (Arc::clone(ended), estop.clone());
    std::thread::Builder::new().name(name.into()).spawn(move || {
        let _alarm = PressedByPanic(estop);
        while !ended.load(Ordering::Acquire) {
            watch();
            std::thread::sleep(EVERY);
        }
    })
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
        if let Some(thread) = self.signal.take() {
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
        let mut bytes = [0; 64];
        loop {
            if !is_in_the_foreground() {
                // Who reads then is suspended, with torque on.
                std::thread::sleep(LOOK_AGAIN);
                continue;
            }
            match std::io::stdin().lock().read(&mut bytes) {
                Ok(0) => std::thread::sleep(EVERY), // Ctrl-D: the next key is read as ever
                Ok(_) => estop.press("the key"),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => {
                    estop.press(&format!("the key cannot be read: {error}"));
                    return;
                }
            }
        }
    })?;
    Ok(())
}

/// Whether the terminal's keys are for this program: for every one, where no shell controls
/// jobs on it.
fn is_in_the_foreground() -> bool {
    let owner = rustix::termios::tcgetpgrp(std::io::stdin());
    owner.map_or(true, |group| group == rustix::process::getpgrp())
}

/// Fails where `file` is something that waits for another program to be opened.
fn refuse_pipes(file: &Path) -> anyhow::Result<()> {
    if is_pipe(file) {
        bail!("--estop-file {}: a pipe or socket; it must be a file", file.display());
    }
    Ok(())
}

fn is_pipe(file: &Path) -> bool {
    let kind = std::fs::metadata(file).map(|about| about.file_type());
    kind.is_ok_and(|kind| kind.is_fifo() || kind.is_socket())
}

fn press_if_it_says_so(estop: &EStop, file: &Path) {
    if is_pressed(file) {
        estop.press(&cause_of(file));
    }
}

fn cause_of(file: &Path) -> String {
    format!("the file {}", file.display())
}

/// Whether the file stands for a pressed button.
fn is_pressed(file: &Path) -> bool {
    if is_pipe(file) {
        return true; // it came in the file's place, and opening it would wait
    }
    let mut bytes = Vec::new();
    let read = File::open(file).and_then(|file| file.take(TELLING).read_to_end(&mut bytes));
    match read {
        Ok(_) => bytes.trim_ascii_start().first() != Some(&b'0'),
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
    fn a_pipe_is_refused_and_one_that_comes_later_is_a_pressed_button() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("stop");
        let _socket = std::os::unix::net::UnixListener::bind(&file).unwrap();
        let estop = EStop::default();
        let refused = EmergencyStopWatch::start(&estop, Some(file.clone()), false).err().unwrap();
        assert!(refused.to_string().contains("it must be a file"), "{refused}");
        assert!(!estop.is_pressed() && is_pressed(&file));
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
