//! What belongs to the whole process: standard output, progress bar, thread
//! priorities, failpoints for tests.

pub mod console;
pub(crate) mod failpoint;
pub mod interrupted;
pub mod number_range;
pub mod output_thread;
pub mod progress;
pub mod realtime;
pub mod speed;
pub mod wrong_usage;
