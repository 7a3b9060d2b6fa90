//! Asking before something happens to a live robot.

use crate::process::console::stderr_line;
use anyhow::{Context, bail};
use std::io::{BufRead, IsTerminal, Write};

/// Whether the user has agreed already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Consent {
    /// Ask on the terminal; without one, refuse.
    Ask,
    /// The user gave `--yes`.
    Given,
}

impl Consent {
    /// Consent by the flag `--yes`.
    pub fn from_flag(yes: bool) -> Self {
        if yes { Self::Given } else { Self::Ask }
    }

    /// Goes on if the user agrees to `what`, a sentence that names what will
    /// happen and to whom.
    pub fn obtain(self, what: &str) -> anyhow::Result<()> {
        if self == Self::Given {
            return Ok(());
        }
        if !std::io::stdin().is_terminal() {
            bail!("{what} There is no terminal to ask on: --yes agrees beforehand");
        }
        crate::process::console::stderr(format_args!("{what} Go on? [y/N] "));
        std::io::stderr().flush()?;
        let answer = read_line()?;
        if matches!(answer.trim(), "y" | "Y" | "yes") {
            return Ok(());
        }
        bail!("stopped, nothing was changed");
    }
}

/// Waits for Enter; the end of standard input is as good.
pub fn pause(what: &str) -> anyhow::Result<()> {
    stderr_line!("{what}, then press Enter");
    read_line().map(drop)
}

fn read_line() -> anyhow::Result<String> {
    let mut line = String::new();
    let read = std::io::stdin().lock().read_line(&mut line);
    read.context("cannot read standard input")?;
    Ok(line)
}
