//! The progress bar on standard error.

use crate::process::console::{is_holding, stderr_line};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A progress bar in seconds of music, shared by its clones; says nothing when quiet.
#[derive(Clone)]
pub struct Progress {
    bar: ProgressBar,
    quiet: bool,
}

impl Progress {
    /// A bar up to `duration_s`, or a running count where the end is unknown.
    pub fn new(duration_s: Option<f64>, quiet: bool) -> Self {
        let bar = match duration_s {
            Some(seconds) => ProgressBar::new(seconds.ceil() as u64),
            None => ProgressBar::no_length(),
        };
        let template = match duration_s {
            Some(_) => "dancing {bar:40} {pos}/{len} s of music, {eta} left",
            None => "dancing {spinner} {pos} s of music",
        };
        if quiet || is_holding() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        Self { bar, quiet }.styled(template)
    }

    fn styled(self, template: &str) -> Self {
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style.progress_chars("=> "));
        }
        self
    }

    /// A bar in per cent of other work.
    pub fn share(what: &'static str, quiet: bool) -> Self {
        let template = format!("{what} {{bar:40}} {{pos}} %, {{eta}} left");
        Self::new(Some(100.0), quiet).styled(&template)
    }

    /// A bar in steps of training, from the first that is still to be taken.
    pub fn steps(total: u64, first: u64, quiet: bool) -> Self {
        let template = "{bar:20} {pos}/{len} steps, {msg}, {eta} left";
        let progress = Self::new(Some(total as f64), quiet).styled(template);
        progress.bar.set_position(first);
        progress.bar.reset_eta();
        progress
    }

    /// So many steps are taken, and this is how it goes.
    pub fn step(&self, steps: u64, message: String) {
        self.bar.set_message(message);
        self.bar.set_position(steps);
    }

    /// The work has come this far, seconds of music or per cent.
    pub fn at(&self, time_s: f64) {
        let seconds = time_s.max(0.0) as u64;
        if seconds != self.bar.position() {
            self.bar.set_position(seconds);
        }
    }

    /// One line for the user, above the bar.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            self.bar.suspend(|| stderr_line!("{text}"));
        }
    }

    /// Removes the bar from the terminal.
    pub fn done(&self) {
        self.bar.finish_and_clear();
    }
}
