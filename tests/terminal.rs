//! The terminal view through a pseudo-terminal: what stands on the screen, what
//! keys do, and that the terminal is given back on every way out.

use crate::program::Program;
use crate::torque_off::{alone, signal};
use nix::fcntl::{FcntlArg, FdFlag, fcntl};
use nix::sys::termios::{LocalFlags, tcgetattr};
use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::process::{Child, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use vt100::Parser;

const PATIENCE: Duration = Duration::from_secs(60);

/// A program on a terminal of its own.
struct Screen {
    _program: Program,
    child: Child,
    keys: File,
    /// Held open, so that the terminal outlives the program.
    line: OwnedFd,
    seen: Arc<Mutex<Parser>>,
}

impl Screen {
    /// Dances on a neck, on so many lines of so many cells.
    fn dance(rows: u16, columns: u16, arguments: &[&str], drill: &str) -> Self {
        let size = nix::pty::Winsize { ws_row: rows, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 };
        let terminal = nix::pty::openpty(Some(&size), None).expect("a terminal");
        let program = Program::new();
        let robot = program.unhurried_robot("neck");
        let basics = ["dance", "--robot", &robot, "--tui", "--no-picture"];
        let line = || Stdio::from(terminal.slave.try_clone().expect("the line"));
        let mut command = program.command(&[&basics[..], arguments].concat());
        command.env("SERVODANCE_FAILPOINT", drill);
        command.stdin(line()).stdout(line()).stderr(line());
        let child = command.spawn().expect("it starts");
        let keys = File::from(terminal.master);
        let mut output = keys.try_clone().expect("its output");
        let seen = Arc::new(Mutex::new(Parser::new(rows, columns, 0)));
        let watched = Arc::clone(&seen);
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = output.read(&mut bytes) {
                let mut parser = watched.lock().unwrap_or_else(PoisonError::into_inner);
                parser.process(&bytes[..count]);
            }
        });
        Self { _program: program, child, keys, line: terminal.slave, seen }
    }

    fn parser(&self) -> MutexGuard<'_, Parser> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn text(&self) -> String {
        self.parser().screen().contents()
    }

    fn wait(&self, what: &str, done: impl Fn(&str) -> bool) -> String {
        let start = Instant::now();
        loop {
            let text = self.text();
            if done(&text) {
                return text;
            }
            assert!(start.elapsed() < PATIENCE, "no {what}:\n{text}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn shows(&self, word: &str) -> String {
        self.wait(word, |text| text.contains(word))
    }

    fn press(&mut self, keys: &str) {
        self.keys.write_all(keys.as_bytes()).expect("it listens");
    }

    /// Its end: nothing of the view is left, its last words are read (`word` is
    /// among them), and keys are echoed as before.
    fn ends(&mut self, word: &str) -> (ExitStatus, String) {
        let status = self.child.wait().expect("it ends");
        let text = self.wait(word, |text| {
            let parser = self.parser();
            let usual = !parser.screen().alternate_screen() && !parser.screen().hide_cursor();
            usual && text.contains(word)
        });
        let modes = tcgetattr(&self.line).expect("its modes").local_flags;
        let usual = LocalFlags::ICANON | LocalFlags::ECHO | LocalFlags::ISIG;
        assert!(modes.contains(usual), "{modes:?}");
        (status, text)
    }
}

/// Where the head stands, in the words of the screen.
fn head(text: &str) -> String {
    let line = text.lines().find(|line| line.starts_with("neck_pan"));
    line.unwrap_or_default().to_owned()
}

#[test]
fn the_robot_moves_on_the_screen_and_keys_steer_it() {
    let _alone = alone();
    let mut screen = Screen::dance(24, 80, &[], "");
    let first = head(&screen.shows(" dancing "));
    assert!(first.contains('●') && first.contains('°'), "{first}");
    screen.wait("movement", |text| head(text) != first);
    let text = screen.wait("a beat", |text| text.contains("BPM locked"));
    println!("{text}");
    for word in ["neck", "running", "limits broken 0", "emergency stop"] {
        assert!(text.contains(word), "no {word:?}:\n{text}");
    }
    let spectrum = text.lines().nth(1).unwrap_or_default();
    assert!(spectrum.contains(['▂', '▃', '▄', '▅']), "{spectrum}");

    screen.press("\x1b[B\x1b[B");
    screen.shows("amplitude 80 %");
    screen.press("m");
    screen.shows("mirror on");
    screen.press("n");
    screen.shows("seed 2");
    screen.press("i");
    screen.shows("without music hold");
    screen.press("s");
    screen.shows("--wait-for-start");
    screen.press("h");
    screen.shows(" holding ");
    screen.press("r");
    screen.shows(" running ");
    screen.press("e");
    screen.shows(" finale ");
    let (status, _) = screen.ends("broken at the servos");
    assert!(status.success(), "{status}");
}

#[test]
fn a_key_is_the_emergency_stop_and_the_evening_goes_on() {
    let _alone = alone();
    let mut screen = Screen::dance(24, 80, &["--wait-for-start"], "");
    screen.shows(" waiting ");
    screen.press("s");
    screen.shows(" dancing ");
    screen.press(" ");
    screen.shows("EMERGENCY STOP");
    screen.shows(" waiting ");
    screen.press("s");
    screen.shows("release it first");
    screen.press("x");
    screen.wait("release", |text| !text.contains("EMERGENCY STOP"));
    screen.press("s");
    screen.shows(" dancing ");
    screen.press("\x03");
    let (status, text) = screen.ends("stopped; torque is off");
    assert_eq!(status.code(), Some(130), "{text}");
    assert!(text.contains("emergency stop (the key)"), "{text}");
}

/// Whatever breaks, the terminal is usable again, and says what it was.
#[test]
fn the_terminal_is_given_back_whatever_happens() {
    let _alone = alone();
    for (drill, code, word) in [
        ("panic:control@300", 101, "the thread \"main\" broke down"),
        ("panic:model@60", 1, "broke down"),
        ("panic:terminal view@200", 1, "the terminal view broke down"),
    ] {
        let mut screen = Screen::dance(24, 100, &["--quiet"], drill);
        let (status, text) = screen.ends(word);
        assert_eq!(status.code(), Some(code), "{drill}: {text}");
    }
    let mut screen = Screen::dance(10, 30, &["--quiet"], "");
    screen.shows("dancing");
    signal(&screen.child, "-INT");
    let (status, text) = screen.ends("");
    assert_eq!(status.code(), Some(130), "{text}");
}

/// As when the network to a remote terminal breaks.
#[test]
fn a_terminal_that_goes_away_ends_the_dance() {
    let _alone = alone();
    let size = nix::pty::Winsize { ws_row: 24, ws_col: 80, ws_xpixel: 0, ws_ypixel: 0 };
    let terminal = nix::pty::openpty(Some(&size), None).expect("a terminal");
    // The program must not keep its own terminal alive.
    fcntl(&terminal.master, FcntlArg::F_SETFD(FdFlag::FD_CLOEXEC)).expect("the far end");
    let program = Program::new();
    let robot = program.unhurried_robot("neck");
    let line = || Stdio::from(terminal.slave.try_clone().expect("the line"));
    let mut command = program.command(&["dance", "--robot", &robot, "--tui", "--no-picture"]);
    let mut child = command.stdin(line()).stdout(line()).stderr(line()).spawn().expect("it starts");
    drop((command, terminal.slave));
    let mut screen = File::from(terminal.master);
    let (mut seen, mut bytes) = (Vec::new(), [0; 4096]);
    while !String::from_utf8_lossy(&seen).contains("neck_pan") {
        let count = screen.read(&mut bytes).expect("a screen");
        seen.extend_from_slice(&bytes[..count]);
    }
    drop(screen);
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().expect("its state") {
            break status;
        }
        assert!(start.elapsed() < PATIENCE, "it goes on for nobody");
        std::thread::sleep(Duration::from_millis(5));
    };
    assert_eq!(status.code(), Some(1), "an emergency stop");
}

#[test]
fn without_a_terminal_it_is_refused() {
    let program = Program::new();
    program.refused(&["dance", "--tui"], &["--tui", "standard output"]);
    program.refused(&["dance", "--tui", "--speed", "max"], &["real time"]);
}
