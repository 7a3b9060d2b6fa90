//! The terminal view: the robot in figures and bars, and keys to steer it by.
//!
//! A thread draws snapshots and reads keys, both through [`super::link`]: the
//! control loop never waits for a terminal. Messages of the program are held back
//! meanwhile (`console::HeldLines`).
//!
//! The terminal is restored at the end, on errors, Ctrl-C and panics. If the view
//! fails or its terminal goes away, the emergency stop is pressed, because no key
//! could press it any more.

mod joints;
mod keys;
mod screen;

use super::link::ViewerEnd;
use super::scene::Scene;
use crate::process::console::{HeldLines, stderr_line};
use crate::process::failpoint;
use anyhow::{Context, bail};
use keys::{KeyAction, SettingKeys};
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::cursor::{Hide, Show};
use ratatui::crossterm::event::{self, Event};
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{
    EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use screen::{Remark, draw};
use servodance_drivers::EStop;
use std::fs::File;
use std::io::{IsTerminal, Stdout, stdout};
use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Pictures a second: as many as eyes follow in text.
const FRAMES_HZ: f64 = 15.0;
/// How long a view that is over is waited for.
const ENDS_WITHIN: Duration = Duration::from_secs(1);

/// A terminal that shows a dance until this is dropped.
pub struct TerminalView {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    _kept: HeldLines,
}

impl TerminalView {
    /// Whether there is a terminal to show anything on.
    pub fn check() -> anyhow::Result<()> {
        if !stdout().is_terminal() {
            bail!("--tui: standard output is no terminal");
        }
        Ok(())
    }

    /// Takes the terminal; `stop` is what Ctrl-C sets, `address` that of the page, if any.
    pub fn start(
        scene: Scene,
        end: ViewerEnd,
        stop: &Arc<AtomicBool>,
        address: Option<&str>,
    ) -> anyhow::Result<Self> {
        Self::check()?;
        let screen = RawTerminal::take().context("--tui: the terminal cannot be set up")?;
        let keyboard = keyboard().context("--tui: no keyboard")?;
        let over = Arc::new(AtomicBool::new(false));
        let view = TerminalLoop {
            keyboard,
            keys: SettingKeys::new(scene.styles.len()),
            scene,
            on_panic: StopOnPanic(end.estop.clone()),
            end,
            stop: Arc::clone(stop),
            over: Arc::clone(&over),
            address: address.map(str::to_owned),
            remark: Remark::default(),
        };
        let kept = HeldLines::begin();
        let thread = std::thread::Builder::new().name("terminal view".into());
        let thread = thread.spawn(move || view.run(screen))?;
        Ok(Self { over, thread: Some(thread), _kept: kept })
    }
}

impl Drop for TerminalView {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        let Some(thread) = self.thread.take() else { return };
        let asked = Instant::now();
        while !thread.is_finished() {
            // It hangs in a terminal that went away in the middle of a key.
            if asked.elapsed() > ENDS_WITHIN {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        // A panic there has been told, and has pressed the button.
        let _ = thread.join();
    }
}

/// Where `crossterm` reads keys.
fn keyboard() -> std::io::Result<OwnedFd> {
    let stdin = std::io::stdin();
    match stdin.is_terminal() {
        true => stdin.as_fd().try_clone_to_owned(),
        false => Ok(File::open("/dev/tty")?.into()),
    }
}

/// Whether a key is pressed within this time. Fails when the terminal is gone: the wait of
/// `crossterm` would not notice, and never end.
fn wait_for_key(keyboard: &OwnedFd, patience: Duration) -> std::io::Result<bool> {
    let mut wanted = [PollFd::new(keyboard, PollFlags::IN)];
    let patience = Timespec::try_from(patience).map_err(std::io::Error::other)?;
    match poll(&mut wanted, Some(&patience)) {
        Err(Errno::INTR) => return Ok(false),
        polled => polled?,
    };
    let found = wanted[0].revents();
    if found.intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL) {
        return Err(std::io::Error::other("the terminal went away"));
    }
    Ok(found.contains(PollFlags::IN))
}

/// The terminal as programs like this want it: each key at once, nothing
/// echoed, a screen of its own. Dropped, it is as it was.
struct RawTerminal(());

impl RawTerminal {
    fn take() -> std::io::Result<Self> {
        enable_raw_mode()?;
        let raw = Self(());
        execute!(stdout(), EnterAlternateScreen, Hide)?;
        Ok(raw)
    }
}

impl Drop for RawTerminal {
    fn drop(&mut self) {
        // A terminal that is gone needs nothing.
        let _ = execute!(stdout(), Show, LeaveAlternateScreen);
        let _ = disable_raw_mode();
    }
}

struct StopOnPanic(EStop);

impl Drop for StopOnPanic {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.press("the terminal view broke down");
        }
    }
}

struct TerminalLoop {
    scene: Scene,
    keyboard: OwnedFd,
    end: ViewerEnd,
    keys: SettingKeys,
    stop: Arc<AtomicBool>,
    over: Arc<AtomicBool>,
    address: Option<String>,
    remark: Remark,
    on_panic: StopOnPanic,
}

impl TerminalLoop {
    fn run(mut self, _screen: RawTerminal) {
        if let Err(error) = self.show() {
            self.on_panic.0.press("the terminal went away");
            stderr_line!("--tui: {error}");
        }
    }

    /// Draws and listens until it is over.
    fn show(&mut self) -> std::io::Result<()> {
        let mut terminal = Terminal::new(CrosstermBackend::new(stdout()))?;
        let mut due = Instant::now();
        while !self.over.load(Ordering::Acquire) {
            failpoint::pass("terminal view");
            if wait_for_key(&self.keyboard, due.saturating_duration_since(Instant::now()))? {
                while event::poll(Duration::ZERO)? {
                    if let Event::Key(key) = event::read()? {
                        self.apply(keys::key_action(key));
                    }
                }
            } else {
                self.draw(&mut terminal)?;
                due = Instant::now() + Duration::from_secs_f64(1.0 / FRAMES_HZ);
            }
        }
        Ok(())
    }

    fn draw(&mut self, terminal: &mut Terminal<CrosstermBackend<Stdout>>) -> std::io::Result<()> {
        let pressed = self.end.estop.is_pressed();
        let now = self.end.newest();
        let (scene, remark) = (&self.scene, &self.remark);
        let address = self.address.as_deref();
        terminal.draw(|frame| draw(frame, scene, now, pressed, remark, address))?;
        Ok(())
    }

    fn apply(&mut self, key_action: Option<KeyAction>) {
        let Some(key_action) = key_action else { return };
        let now = self.end.newest().now;
        let request = match key_action {
            KeyAction::EStop => return self.end.estop.press("the key"),
            KeyAction::Quit => return self.stop.store(true, Ordering::Release),
            KeyAction::Do(request) => request,
            KeyAction::Set(change) => self.keys.request(change, now.settings),
        };
        let pressed = self.end.estop.is_pressed();
        let refused = request.possible(now.activity, pressed).err();
        let refused = match refused {
            None if self.end.ask(&[request]) => None,
            None => Some("too many requests".into()),
            why => why,
        };
        self.remark = refused.map_or_else(Remark::default, Remark::new);
    }
}
