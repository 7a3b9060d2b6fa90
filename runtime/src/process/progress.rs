//! The progress bar on standard error.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::process::console::{is_holding, stderr_line};
use crate::process::output_thread::OutputThread;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

enum Event {
    At(u64),
    Step(u64, String),
    Note(String),
    Done,
}

/// A progress bar in seconds of music, shared by its clones; says nothing when quiet. Reporting
/// never waits for the terminal.
#[derive(Clone)]
pub struct Progress {
    output: Arc<OutputThread<Event>>,
    /// What was told last: a control loop reports in every cycle.
    told: Arc<AtomicU64>,
    quiet: bool,
}

impl Progress {
    /// A bar up to `duration_s`, or a running count where the end is unknown.
    pub fn new(duration_s: Option<f64>, quiet: bool) -> Self {
        let template = match duration_s {
            Some(_) => "dancing {bar:40} {pos}/{len} s of music, {eta} left",
            None => "dancing {spinner} {pos} s of music",
        };
        Self::drawn_by(bar(duration_s.map(|seconds| seconds.ceil() as u64), template, quiet), quiet)
    }

    /// A bar in per cent of other work.
    pub fn share(what: &'static str, quiet: bool) -> Self {
        let template = format!("{what} {{bar:40}} {{pos}} %, {{eta}} left");
        Self::drawn_by(bar(Some(100), &template, quiet), quiet)
    }

    /// A bar in steps of training, from the first that is still to be taken.
    pub fn steps(total: u64, first: u64, quiet: bool) -> Self {
        let template = "{bar:20} {pos}/{len} steps, {msg}, {eta} left";
        let bar = bar(Some(total), template, quiet);
        bar.set_position(first);
        bar.reset_eta();
        Self::drawn_by(bar, quiet)
    }

    fn drawn_by(bar: ProgressBar, quiet: bool) -> Self {
        let draw = move |event| match event {
            Event::At(place) => bar.set_position(place),
            Event::Step(steps, message) => {
                bar.set_message(message);
                bar.set_position(steps);
            }
            Event::Note(text) => bar.suspend(|| stderr_line!("{text}")),
            Event::Done => bar.finish_and_clear(),
        };
        Self { output: Arc::new(OutputThread::start(draw)), told: Arc::default(), quiet }
    }

    /// So many steps are taken, and this is how it goes.
    pub fn step(&self, steps: u64, message: String) {
        self.output.send(Event::Step(steps, message));
    }

    /// The work has come this far, seconds of music or per cent.
    pub fn at(&self, time_s: f64) {
        let place = time_s.max(0.0) as u64;
        if self.told.swap(place, Ordering::Relaxed) != place {
            self.output.send(Event::At(place));
        }
    }

    /// One line for the user, above the bar.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            self.output.send(Event::Note(text.into()));
        }
    }

    /// Removes the bar from the terminal; all that was told is there.
    pub fn done(&self) {
        self.output.send(Event::Done);
        self.output.flush();
    }
}

fn bar(length: Option<u64>, template: &str, quiet: bool) -> ProgressBar {
    let bar = length.map_or_else(ProgressBar::no_length, ProgressBar::new);
    if quiet || is_holding() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    match ProgressStyle::with_template(template) {
        Ok(style) => bar.with_style(style.progress_chars("=> ")),
        Err(_) => bar,
    }
}
