//! What the user sees while it works: a bar on standard error.

use crate::process::console::{is_kept, tell};
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
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        if quiet || is_kept() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        Self { bar, quiet }
    }

    /// A bar in per cent of other work.
    pub fn share(what: &'static str, quiet: bool) -> Self {
        let progress = Self::new(Some(100.0), quiet);
        let template = format!("{what} {{bar:40}} {{pos}} %, {{eta}} left");
        if let Ok(style) = ProgressStyle::with_template(&template) {
            progress.bar.set_style(style.progress_chars("=> "));
        }
        progress
    }

    /// A bar in steps of training, from the first that is still to be taken.
    pub fn steps(total: u64, first: u64, quiet: bool) -> Self {
        let progress = Self::new(Some(total as f64), quiet);
        let template = "{bar:20} {pos}/{len} steps, {msg}, {eta} left";
        if let Ok(style) = ProgressStyle::with_template(template) {
            progress.bar.set_style(style.progress_chars("=> "));
        }
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
            self.bar.suspend(|| tell!("{text}"));
        }
    }

    /// Takes the bar away.
    pub fn done(&self) {
        self.bar.finish_and_clear();
    }
}
