//! servodance: a robot hears music and dances to it.
//!
//! This crate puts the parts together: [`robot`] files, the [`session`] from
//! sound to servo, its [`report`], [`record`]ing and [`picture`]. The parts
//! themselves are crates of their own; ARCHITECTURE.md maps them.

// A reader that goes away is no reason to panic: see `process::console`.
#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod bus_tools;
pub mod control;
pub mod doctor;
pub mod export;
pub mod joint_csv;
pub mod offline;
pub mod output;
pub mod picture;
pub mod pipeline;
pub mod process;
pub mod record;
pub mod report;
pub mod robot;
pub mod robot_file;
pub mod session;
pub mod show;
#[cfg(feature = "stage")]
pub mod stage;
