//! servodance: a robot hears music and dances to it.
//!
//! This crate puts the parts together: [`robot`] files, the [`session`] from
//! sound to servo, its [`telemetry`] and its [`viewer`]. The parts
//! themselves are crates of their own; ARCHITECTURE.md maps them.

// A reader that goes away is no reason to panic: see `process::console`.
#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod bus_tools;
pub mod control;
pub mod doctor;
pub mod offline;
pub mod pipeline;
pub mod process;
pub mod robot;
pub mod session;
#[cfg(feature = "stage")]
pub mod stage;
pub mod telemetry;
pub mod viewer;
