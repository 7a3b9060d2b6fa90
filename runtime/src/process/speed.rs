//! Whether a run goes by the wall clock or in simulated time.

use clap::ValueEnum;

/// How fast time passes in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Speed {
    /// As fast as the machine can; time is simulated and runs are repeatable.
    Max,
    /// By the clock on the wall.
    Realtime,
}
